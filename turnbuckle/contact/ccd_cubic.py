"""The paper's continuous collision detection, for comparison: Provot 1997, "Collision and self-collision handling in
cloth model dedicated to design garments" (Contact, section 3.2).

Four points are coplanar when ``det(r_1, r_2, r_3)(t) = 0``, r_k = x_k - x_0: a cubic in time. At each of its roots in
[0, 1], in order, the vertex is looked for inside the face, or the crossing inside both edges. In floating point the
roots are off by round-off, so what happens at corners and on sides of faces is missed by chance; a double root (a pair
that touches and parts) is missed when round-off lifts it; and motion within one plane has no roots at all.
So nothing in Turnbuckle relies on this test.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})

I32 = wp.array(dtype=wp.int32)
U8 = wp.array(dtype=wp.uint8)
F64 = wp.array(dtype=wp.float64)


@wp.func_native(
    r"""
    const int kind = kinds.data[i * kind_step];
    const double *c0 = queries.data + 24 * (long long)i, *c1 = c0 + 12;
    double r[3][3], d[3][3], total = 0.0;
    for (int k = 0; k < 3; ++k)
        for (int c = 0; c < 3; ++c) {
            r[k][c] = c0[3 * k + 3 + c] - c0[c];
            d[k][c] = c1[3 * k + 3 + c] - c1[c] - r[k][c];
            total += fabs(r[k][c]) + fabs(d[k][c]);
        }
    status_out.data[i] = total < 1e150 ? 0 : 2;
    time_out.data[i] = 1.0;
    if (!(total < 1e150)) return;
    auto dot = [](const double *p, const double *q) { return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]; };
    auto det = [](const double *p, const double *q, const double *s) {
        return p[0] * (q[1] * s[2] - q[2] * s[1]) + p[1] * (q[2] * s[0] - q[0] * s[2]) + p[2] * (q[0] * s[1] - q[1] * s[0]);
    };
    const double k0 = det(r[0], r[1], r[2]), k3 = det(d[0], d[1], d[2]);
    const double k1 = det(d[0], r[1], r[2]) + det(r[0], d[1], r[2]) + det(r[0], r[1], d[2]);
    const double k2 = det(r[0], d[1], d[2]) + det(d[0], r[1], d[2]) + det(d[0], d[1], r[2]);
    auto cubic = [&](double t) { return ((k3 * t + k2) * t + k1) * t + k0; };
    // turning points cut [0, 1] into pieces that rise or fall: at most one root each
    double cut[4] = {0.0, 0.0, 0.0, 1.0};
    int cuts = 1;
    const double under = k2 * k2 - 3.0 * k3 * k1;
    if (under >= 0.0) {
        const double q = -(k2 + (k2 < 0.0 ? -sqrt(under) : sqrt(under)));
        double t0 = k3 != 0.0 ? q / (3.0 * k3) : -1.0, t1 = q != 0.0 ? k1 / q : -1.0;
        if (t0 > t1) { const double swap = t0; t0 = t1; t1 = swap; }
        if (t0 > 0.0 && t0 < 1.0) cut[cuts++] = t0;
        if (t1 > 0.0 && t1 < 1.0) cut[cuts++] = t1;
    }
    cut[cuts] = 1.0;
    for (int piece = 0; piece < cuts; ++piece) {
        double low = cut[piece], high = cut[piece + 1];
        const double flow = cubic(low), fhigh = cubic(high);
        if ((flow > 0.0 && fhigh > 0.0) || (flow < 0.0 && fhigh < 0.0) || (flow == 0.0 && fhigh == 0.0)) continue;
        double t = flow == 0.0 ? low : high;
        if (flow != 0.0 && fhigh != 0.0) {
            for (int halving = 0; halving < 64; ++halving) {
                t = 0.5 * (low + high);
                const double f = cubic(t);
                if (f == 0.0) break;
                if ((f > 0.0) == (flow > 0.0)) low = t; else high = t;
            }
        }
        double y[3][3];
        for (int k = 0; k < 3; ++k)
            for (int c = 0; c < 3; ++c) y[k][c] = r[k][c] + t * d[k][c];
        bool inside;
        if (kind) {  // the lines' closest points lie on both edges
            double w[3];
            for (int c = 0; c < 3; ++c) w[c] = y[2][c] - y[1][c];
            const double aa = dot(y[0], y[0]), bb = dot(w, w), ab = dot(y[0], w), ay = dot(y[0], y[1]), by = dot(w, y[1]);
            const double area = aa * bb - ab * ab, s = ay * bb - by * ab, v = ay * ab - by * aa;
            inside = area > 0.0 && s >= 0.0 && s <= area && v >= 0.0 && v <= area;
        } else {  // weights of the face's corners
            double p[3], q[3];
            for (int c = 0; c < 3; ++c) { p[c] = y[1][c] - y[0][c]; q[c] = y[2][c] - y[0][c]; }
            const double pp = dot(p, p), qq = dot(q, q), pq = dot(p, q), py = -dot(p, y[0]), qy = -dot(q, y[0]);
            const double area = pp * qq - pq * pq, s = py * qq - qy * pq, v = qy * pp - py * pq;
            inside = area > 0.0 && s >= 0.0 && v >= 0.0 && s + v <= area;
        }
        if (inside) {
            status_out.data[i] = 1;
            time_out.data[i] = t;
            return;
        }
    }
"""
)
def _cubic_query(queries: F64, kinds: I32, kind_step: int, status_out: U8, time_out: F64, i: int): ...


@wp.kernel
def cubic_queries(begin: int, queries: F64, kinds: I32, kind_step: int, status_out: U8, time_out: F64):
    """Provot's test of query i: the first root of the cubic at which the pair meets."""
    _cubic_query(queries, kinds, kind_step, status_out, time_out, begin + wp.tid())
