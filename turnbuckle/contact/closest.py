"""Closest points of a vertex and a face, and of two edges, in float64.

Every way in which the closest features can be smaller than the pair's own is tried and the nearest taken: this costs
little more than a decision tree and stays right for parallel edges and for faces and edges without area or length.
The inside of both counts only where it is strictly nearer; then the normal comes from a cross product, which keeps its
digits however small the distance.
"""

import warp as wp

from turnbuckle.math.types import vec3

wp.set_module_options({"enable_backward": False})

F64 = wp.array(dtype=wp.float64)
I32 = wp.array(dtype=wp.int32)

SLOT = 16  # numbers of a place in the scratch: 0 to 3 coefficients, 4 to 6 normal, 7 distance, 8 size, 9 noise of the normal


# Shared by the two functions below. Positions are taken relative to one vertex first: what follows then errs relative to
# the size of the pair, not to its distance from the origin.
_SEGMENT = """
    auto dot = [](const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
    // p to the segment a b: weight of b, squared distance; the vector a b t to p goes to out
    auto segment = [&](const double *p, const double *a, const double *b, double *t_out, double *out) {
        double d[3], r[3];
        for (int k = 0; k < 3; ++k) { d[k] = b[k] - a[k]; r[k] = p[k] - a[k]; }
        const double l = dot(d, d), along = dot(d, r);
        double t = 0.0;
        if (along > 0.0 && l > 0.0) t = along < l ? along / l : 1.0;
        if (t == 1.0) for (int k = 0; k < 3; ++k) out[k] = p[k] - b[k];
        else for (int k = 0; k < 3; ++k) out[k] = r[k] - t * d[k];
        *t_out = t;
        return dot(out, out);
    };
    auto length = [&](const double *v) {  // scaled: squares of tiny coordinates vanish
        double big = 0.0;
        for (int k = 0; k < 3; ++k) { const double m = v[k] < 0.0 ? -v[k] : v[k]; big = m > big ? m : big; }
        if (!(big > 0.0)) return 0.0;
        const double s[3] = {v[0] / big, v[1] / big, v[2] / big};
        return big * sqrt(dot(s, s));
    };
"""

_FINISH = """
    double size = 0.0;
    for (int k = 0; k < 9; ++k) { const double m = p[k] < 0.0 ? -p[k] : p[k]; size = m > size ? m : size; }
    double l = length(between);
    double noise = 1e-9;
    if (inside) noise += 4e-16 * inside_noise;
    else if (l > 0.0) noise += 4e-15 * size / l;
    out[7] = inside ? inside_distance : l;
    out[8] = size;
    out[9] = noise;
    const double *n = inside ? cross : between;
    const double norm = length(n);
    for (int k = 0; k < 3; ++k) out[4 + k] = norm > 0.0 ? n[k] / norm : 0.0;
    int mask = 0;
    for (int k = 0; k < 4; ++k) mask |= (out[k] != 0.0) << k;
    return mask;
"""


@wp.func_native(
    """
    const double *base = (const double *)x.data;
    const double *o = base + 3 * v;
    double *out = scratch.data + 16 * slot;
    const int corner[3] = {f0, f1, f2};
    double p[9];  // corners relative to the vertex
    for (int c = 0; c < 3; ++c)
        for (int k = 0; k < 3; ++k) p[3 * c + k] = base[3 * corner[c] + k] - o[k];
    const double zero[3] = {0.0, 0.0, 0.0};
"""
    + _SEGMENT
    + """
    double w[3] = {0.0, 0.0, 0.0}, between[3] = {0.0, 0.0, 0.0}, best = -1.0;
    for (int c = 0; c < 3; ++c) {
        const int next = c == 2 ? 0 : c + 1;
        double t, way[3];
        // always from the lower vertex number: faces that share an edge find the same place, bit by bit
        const int from = corner[c] < corner[next] ? c : next, to = from == c ? next : c;
        const double d = segment(zero, p + 3 * from, p + 3 * to, &t, way);
        if (best < 0.0 || d < best) {
            best = d;
            w[0] = w[1] = w[2] = 0.0;
            w[from] = 1.0 - t;
            w[to] = t;
            for (int k = 0; k < 3; ++k) between[k] = way[k];
        }
    }
    double e1[3], e2[3], cross[3];
    for (int k = 0; k < 3; ++k) { e1[k] = p[3 + k] - p[k]; e2[k] = p[6 + k] - p[k]; }
    for (int k = 0; k < 3; ++k) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        cross[k] = e1[i] * e2[j] - e1[j] * e2[i];
    }
    const double area2 = dot(cross, cross);
    bool inside = false;
    double inside_distance = 0.0, inside_noise = 0.0;
    if (area2 > 0.0) {
        double weight[3];
        bool in = true;
        for (int c = 0; c < 3; ++c) {  // weight of corner c: (p1 x p2) . n / n^2
            const double *a = p + 3 * ((c + 1) % 3), *b = p + 3 * ((c + 2) % 3);
            double s = 0.0;
            for (int k = 0; k < 3; ++k) {
                const int i = (k + 1) % 3, j = (k + 2) % 3;
                s += (a[i] * b[j] - a[j] * b[i]) * cross[k];
            }
            weight[c] = s / area2;
            in = in && s > 0.0;
        }
        const double sum = weight[0] + weight[1] + weight[2];
        const double n = sqrt(area2), h = -dot(p, cross) / n;  // signed distance of the vertex
        if (in && sum > 0.5 && sum < 2.0 && h * h < best) {
            inside = true;
            for (int c = 0; c < 3; ++c) w[c] = weight[c] / sum;
            inside_distance = h < 0.0 ? -h : h;
            inside_noise = length(e1) * length(e2) / n;
            if (h < 0.0) for (int k = 0; k < 3; ++k) cross[k] = -cross[k];
        }
    }
    out[0] = 1.0;
    for (int c = 0; c < 3; ++c) out[1 + c] = -w[c];
"""
    + _FINISH
)
def closest_vertex_face(x: wp.array(dtype=vec3), v: int, f0: int, f1: int, f2: int, scratch: F64, slot: int) -> int:
    """Closest place on a face; which of the four coefficients are not 0. At distance 0 the normal of a face may be 0."""
    ...  # fmt: skip


@wp.func_native(
    """
    const double *base = (const double *)x.data;
    const double *o = base + 3 * a0;
    double *out = scratch.data + 16 * slot;
    const int corner[3] = {a1, b0, b1};
    double p[9];
    for (int c = 0; c < 3; ++c)
        for (int k = 0; k < 3; ++k) p[3 * c + k] = base[3 * corner[c] + k] - o[k];
    const double zero[3] = {0.0, 0.0, 0.0};
    const double *pa0 = zero, *pa1 = p, *pb0 = p + 3, *pb1 = p + 6;
"""
    + _SEGMENT
    + """
    double between[3] = {0.0, 0.0, 0.0}, best = -1.0, s = 0.0, t = 0.0;
    for (int c = 0; c < 4; ++c) {  // ends of a on b, then ends of b on a
        double u, way[3];
        const double d = c < 2 ? segment(c ? pa1 : pa0, pb0, pb1, &u, way) : segment(c == 3 ? pb1 : pb0, pa0, pa1, &u, way);
        if (best < 0.0 || d < best) {
            best = d;
            s = c < 2 ? (double)c : u;
            t = c < 2 ? u : (double)(c - 2);
            for (int k = 0; k < 3; ++k) between[k] = c < 2 ? way[k] : -way[k];
        }
    }
    double e[3], cross[3];
    for (int k = 0; k < 3; ++k) e[k] = pb1[k] - pb0[k];
    for (int k = 0; k < 3; ++k) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        cross[k] = pa1[i] * e[j] - pa1[j] * e[i];
    }
    const double n2 = dot(cross, cross);
    bool inside = false;
    double inside_distance = 0.0, inside_noise = 0.0;
    if (n2 > 1e-24 * dot(pa1, pa1) * dot(e, e)) {
        // s u - t e + d n = b0: s = (b0 x e) . n / n^2, t = (b0 x u) . n / n^2
        double at = 0.0, bt = 0.0;
        for (int k = 0; k < 3; ++k) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            at += (pb0[i] * e[j] - pb0[j] * e[i]) * cross[k];
            bt += (pb0[i] * pa1[j] - pb0[j] * pa1[i]) * cross[k];
        }
        const double n = sqrt(n2), h = -dot(pb0, cross) / n;
        at /= n2;
        bt /= n2;
        if (at > 0.0 && at < 1.0 && bt > 0.0 && bt < 1.0 && h * h < best) {
            inside = true;
            s = at;
            t = bt;
            inside_distance = h < 0.0 ? -h : h;
            inside_noise = length(pa1) * length(e) / n;
            if (h < 0.0) for (int k = 0; k < 3; ++k) cross[k] = -cross[k];
        }
    }
    out[0] = 1.0 - s;
    out[1] = s;
    out[2] = t - 1.0;
    out[3] = -t;
"""
    + _FINISH
)
def closest_edge_edge(x: wp.array(dtype=vec3), a0: int, a1: int, b0: int, b1: int, scratch: F64, slot: int) -> int:
    """Closest places on two edges; which of the four coefficients are not 0."""
    ...  # fmt: skip
