"""Additive continuous collision detection of one pair: the arithmetic, as C text that the kernels of CCD share.

Method. Additive CCD (Li, Kaufman, Jiang 2021, "Codimensional Incremental Potential Contact", section 4) walks along the
step by times that surely hold no impact, until the gap is a small part of what it was. It bounds the approach by the
longest relative displacement. Here the bound is taken along the line between the closest points, which is never worse:
for ANY direction n (unit, from b to a), the distance of two convex hulls is at least

    f(t) = min_ij n . (a_i(t) - b_j(t)),    i, j over the corners of a and of b,

and with linear motion each of the 3 (vertex-face) or 4 (edge-edge) terms is linear in t. So {t: f(t) >= target} is one
interval, known in closed form, in which n *certifies* the pair. The walk covers [0, 1] with such intervals, n being
that of the closest points where the last interval ended; each interval stands for itself, so nothing is summed up.
Whatever is wrong with n (slivers, parallel edges, zero-length edges, round-off) costs tightness, never a miss.

Round-off. u = 2^-53. Positions enter only as differences r_k = x_k - x_0 within a pair at the start and at the end,
r_k(t) being linear too. A difference of floats has a relative error u per coordinate, so the size of the coordinates
themselves does not matter, only that of the pair: R, the longest of the six r_k.
    n . r_k in floating point:           at most 3 u |n| R, and u |n| R from r_k itself          4 u R
    a term of f (two of those, - ):      2 * 4 u R + u * 2 R                                    10 u R
    |n| may exceed 1 by 4 u:             f / |n| >= f - 4 u * 2 R                                8 u R
    time where a term is `target`:       relative error 3 u, times |slope|: 3 u * 2 R            6 u R
    target = xi + E + slack, rounded:    2 u R (a target above 2 R is never met)                 2 u R
Together 26 u R; E = 32 u R is added to the separation xi, and taken off the gaps that are returned.
Very small and very large pairs are scaled by powers of two before anything is squared.

Result. With G = gap at the start - xi - E, the walk ends with a hit where the gap has come down to xi + E + s G
(s is `tightness`), or at the last time reached when the iterations run out; a hit at time 0 when G <= 0 (touching, or nearer
than xi, at the start). A pair that never comes nearer than that is clear. The time is never later than the true one.
"""

# The direction n, from b to a, of the closest points where the corners are now (y), and the distance of those points.
# Closest points lose digits when the distance is small beside the pair, so n is then made orthogonal to what the points
# lie on: to the face (or to both edges) by a cross product, to one edge by projection.
CLOSEST = r"""
            if (kind) {
                for (int c = 0; c < 3; ++c) w[c] = y[2][c] - y[1][c];  // edge b; edge a is y[0], from the origin
                const double aa = dot(y[0], y[0]), bb = dot(w, w), ab = dot(y[0], w);
                const double ca = -dot(y[0], y[1]), fb = -dot(w, y[1]);
                const double denominator = aa * bb - ab * ab;
                double s = 0.0, t = 0.0;
                if (aa > 0.0 && bb > 0.0) {
                    s = denominator > 0.0 ? clamped((ab * fb - ca * bb) / denominator) : 0.0;
                    t = (ab * s + fb) / bb;
                    if (t < 0.0) { t = 0.0; s = clamped(-ca / aa); }
                    else if (t > 1.0) { t = 1.0; s = clamped((ab - ca) / aa); }
                } else if (aa > 0.0) {
                    s = clamped(-ca / aa);
                } else if (bb > 0.0) {
                    t = clamped(fb / bb);
                }
                for (int c = 0; c < 3; ++c) n[c] = s * y[0][c] - y[1][c] - t * w[c];
                length = sqrt(dot(n, n));
                const bool inside_a = s > 0.0 && s < 1.0, inside_b = t > 0.0 && t < 1.0;
                if (inside_a && inside_b) {
                    if (denominator > 1e-16 * aa * bb) across(y[0], w, y[1], n);
                } else if (inside_a) {
                    away(n, y[0], aa);
                } else if (inside_b) {
                    away(n, w, bb);
                }
                wa = s; wb = t;
            } else {
                double p[3], q[3];  // sides of the face at its first corner; the vertex is the origin
                for (int c = 0; c < 3; ++c) { p[c] = y[1][c] - y[0][c]; q[c] = y[2][c] - y[0][c]; }
                const double d1 = -dot(p, y[0]), d2 = -dot(q, y[0]), d3 = -dot(p, y[1]), d4 = -dot(q, y[1]);
                const double d5 = -dot(p, y[2]), d6 = -dot(q, y[2]);
                const double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
                int side = 0;  // 0: at a corner; 1, 2, 3: on a side; 4: inside
                double s = 0.0, t = 0.0;  // weights of the second and third corner
                if (d1 <= 0.0 && d2 <= 0.0) {
                } else if (d3 >= 0.0 && d4 <= d3) { s = 1.0;
                } else if (d6 >= 0.0 && d5 <= d6) { t = 1.0;
                } else if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) { s = d1 / (d1 - d3); side = 1;
                } else if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) { t = d2 / (d2 - d6); side = 2;
                } else if (va <= 0.0 && d4 >= d3 && d5 >= d6) { t = (d4 - d3) / ((d4 - d3) + (d5 - d6)); s = 1.0 - t; side = 3;
                } else { const double scale = 1.0 / (va + vb + vc); s = vb * scale; t = vc * scale; side = 4; }
                for (int c = 0; c < 3; ++c) n[c] = -y[0][c] - s * p[c] - t * q[c];
                length = sqrt(dot(n, n));
                if (side == 4) {
                    across(p, q, y[0], n);
                } else if (side == 1) {
                    away(n, p, dot(p, p));
                } else if (side == 2) {
                    away(n, q, dot(q, q));
                } else if (side == 3) {
                    for (int c = 0; c < 3; ++c) w[c] = y[2][c] - y[1][c];
                    away(n, w, dot(w, w));
                }
                wa = s; wb = t;
            }
"""

# Functions of the text above and below.
TOOLS = r"""
        auto dot = [](const double *p, const double *q) { return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]; };
        auto clamped = [](double s) { return s < 0.0 ? 0.0 : s > 1.0 ? 1.0 : s; };
        auto away = [&](double *n, const double *p, double pp) {  // n made orthogonal to p
            if (pp > 0.0) {
                const double part = dot(n, p) / pp;
                for (int c = 0; c < 3; ++c) n[c] -= part * p[c];
            }
        };
        auto across = [&](const double *p, const double *q, const double *from, double *n) {  // +-p x q, away from `from`
            n[0] = p[1] * q[2] - p[2] * q[1];
            n[1] = p[2] * q[0] - p[0] * q[2];
            n[2] = p[0] * q[1] - p[1] * q[0];
            if (dot(n, from) > 0.0)
                for (int c = 0; c < 3; ++c) n[c] = -n[c];
        };
"""

# Where n certifies much less than the distance, or would end the walk: the best of all directions that can be those of
# closest points (corner to corner, corner to line, normal of the face or of both edges), and n itself.
BEST = r"""
        auto best_direction = [&](const double y[3][3], double n[3], double now) {
            double best[3] = {n[0], n[1], n[2]}, m[3], g[3], from[3];
            const double corner[4][3] = {{0.0, 0.0, 0.0}, {y[0][0], y[0][1], y[0][2]}, {y[1][0], y[1][1], y[1][2]},
                                         {y[2][0], y[2][1], y[2][2]}};
            auto attempt = [&]() {
                const double value = along(m[0], m[1], m[2]);
                if (value > now) { now = value; best[0] = m[0]; best[1] = m[1]; best[2] = m[2]; }
            };
            const int own = kind ? 2 : 1;  // corners of a
            for (int i = 0; i < own; ++i)
                for (int j = own; j < 4; ++j) {
                    for (int c = 0; c < 3; ++c) m[c] = corner[i][c] - corner[j][c];
                    attempt();
                    const int other = j + 1 < 4 ? j + 1 : own;  // the line of b through j
                    for (int c = 0; c < 3; ++c) g[c] = corner[other][c] - corner[j][c];
                    away(m, g, dot(g, g));
                    away(m, g, dot(g, g));
                    attempt();
                    if (kind) {  // and that of a through i
                        for (int c = 0; c < 3; ++c) { m[c] = corner[i][c] - corner[j][c]; g[c] = y[0][c]; }
                        away(m, g, dot(g, g));
                        away(m, g, dot(g, g));
                        attempt();
                    }
                }
            for (int c = 0; c < 3; ++c) {
                g[c] = kind ? y[0][c] : y[1][c] - y[0][c];
                from[c] = kind ? y[2][c] - y[1][c] : y[2][c] - y[0][c];
            }
            across(g, from, kind ? y[1] : y[0], m);
            attempt();
            for (int c = 0; c < 3; ++c) n[c] = best[c];
            return along(n[0], n[1], n[2]);
        };
"""

# Expects: const int kind; double c0[12], c1[12] (four corners at the start and at the end); double xi, tightness;
# const int limit. Gives: int status (0 clear, 1 hit, 2 not finite), double time, double gap (certified over [0, time]).
WALK = (
    r"""
    int status = 0;
    double time = 0.0, gap = 0.0;
    double r[3][3], e[3][3], d[3][3];  // r_k at the start, at the end, and the difference
    double total = 0.0;
    for (int k = 0; k < 3; ++k)
        for (int c = 0; c < 3; ++c) {
            r[k][c] = c0[3 * k + 3 + c] - c0[c];
            e[k][c] = c1[3 * k + 3 + c] - c1[c];
            total += fabs(r[k][c]) + fabs(e[k][c]);
        }
    if (!(total < 1e150)) {
        status = 2;
    } else {
        int unit = 0;  // lengths have been multiplied by 2^(200 unit)
        while (total > 0.0 && (total < 1e-30 || total > 1e60)) {
            const double by = total < 1.0 ? 0x1p200 : 0x1p-200;
            unit += total < 1.0 ? 1 : -1;
            total *= by; xi *= by;
            for (int k = 0; k < 3; ++k)
                for (int c = 0; c < 3; ++c) { r[k][c] *= by; e[k][c] *= by; }
        }
        double size = 0.0;
        for (int k = 0; k < 3; ++k) {
            const double l0 = r[k][0] * r[k][0] + r[k][1] * r[k][1] + r[k][2] * r[k][2];
            const double l1 = e[k][0] * e[k][0] + e[k][1] * e[k][1] + e[k][2] * e[k][2];
            size = size > l0 ? size : l0;
            size = size > l1 ? size : l1;
            for (int c = 0; c < 3; ++c) d[k][c] = e[k][c] - r[k][c];
        }
        const double margin = 0x1p-48 * sqrt(size);  // 32 u R
        const double least = xi + margin;
        double target = least, stop = least, walked = 0.0;
        double y[3][3];  // r_k now
        double f0[4], f1[4];  // terms of f at the start and at the end
        const int terms = kind ? 4 : 3;
        TOOLS
        // f along a direction of any length: its value now, terms in f0 and f1; -1e300 for a direction of no length
        auto along = [&](double n0, double n1, double n2) {
            const double l2 = n0 * n0 + n1 * n1 + n2 * n2;
            if (!(l2 > 1e-290)) return -1e300;
            const double scale = 1.0 / sqrt(l2);
            n0 *= scale; n1 *= scale; n2 *= scale;
            double q0[3], q1[3];
            for (int k = 0; k < 3; ++k) {
                q0[k] = n0 * r[k][0] + n1 * r[k][1] + n2 * r[k][2];
                q1[k] = n0 * e[k][0] + n1 * e[k][1] + n2 * e[k][2];
            }
            if (kind) {
                f0[0] = -q0[1]; f0[1] = -q0[2]; f0[2] = q0[0] - q0[1]; f0[3] = q0[0] - q0[2];
                f1[0] = -q1[1]; f1[1] = -q1[2]; f1[2] = q1[0] - q1[1]; f1[3] = q1[0] - q1[2];
            } else {
                for (int k = 0; k < 3; ++k) { f0[k] = -q0[k]; f1[k] = -q1[k]; }
            }
            double value = 1e300;
            for (int k = 0; k < terms; ++k) {
                const double f = f0[k] + walked * (f1[k] - f0[k]);
                value = value < f ? value : f;
            }
            return value;
        };
        BEST
        gap = 1e300;
        status = 1;
        for (int iteration = 0; iteration < limit; ++iteration) {
            for (int k = 0; k < 3; ++k)
                for (int c = 0; c < 3; ++c) y[k][c] = r[k][c] + walked * d[k][c];
            double n[3], w[3];
            double length, wa, wb;  // of the vector between the closest points, and their weights
            CLOSEST
            double now = along(n[0], n[1], n[2]);
            if (now < 0.5 * length || now <= least) now = best_direction(y, n, now);
            if (iteration == 0) {
                if (!(now > least)) { gap = now - margin; break; }
                target = least + 0.5 * tightness * (now - least);
                stop = least + tightness * (now - least);
            }
            if (!(now > stop)) break;
            // an interval ends where a quarter of the gap is left, so the gap that is certified is worth something
            const double quarter = least + 0.25 * (now - least);
            const double aim = quarter > target ? quarter : target;
            double low = 0.0, high = 2.0;
            for (int k = 0; k < terms; ++k) {
                if (f1[k] < aim) {
                    const double reach = f0[k] > aim ? (f0[k] - aim) / (f0[k] - f1[k]) : -1.0;
                    high = high < reach ? high : reach;
                } else if (f0[k] < aim) {
                    const double from = (aim - f0[k]) / (f1[k] - f0[k]);
                    low = low > from ? low : from;
                }
            }
            if (low > walked || high <= walked) break;
            const double next = high < 1.0 ? high : 1.0;
            for (int k = 0; k < terms; ++k) {
                const double f = f0[k] + next * (f1[k] - f0[k]) - margin;
                gap = gap < f ? gap : f;
            }
            now -= margin;
            gap = gap < now ? gap : now;
            walked = next;
            if (high > 1.0) { status = 0; break; }
        }
        time = walked;
        gap = gap > 0.0 ? gap : 0.0;
        for (; unit > 0; --unit) gap *= 0x1p-200;
        for (; unit < 0; ++unit) gap *= 0x1p200;
    }
""".replace("TOOLS", TOOLS)
    .replace("BEST", BEST)
    .replace("CLOSEST", CLOSEST)
)

# The contact of a pair at a time of impact. Expects kind, c0, c1 as above and `when`; gives weights of the four corners
# (1, -w or 1 - s, s, -(1 - t), -t), the unit normal from b to a, and the distance at the start.
# The walk ends before the distance is nothing, so the normal is that of the closest points, except for pairs that touch
# at the start: those take the normal of the face (or of both edges), on the side where the pair stood at the start; if
# that is not known either, on the side that the motion comes from; at rest, the face's own side.
TOUCH = r"""
    double r[3][3], e[3][3], y[3][3], n[3], w[3], length, wa, wb, weights[4], unit_normal[3], distance;
    double size = 0.0;
    for (int k = 0; k < 3; ++k)
        for (int c = 0; c < 3; ++c) {
            r[k][c] = c0[3 * k + 3 + c] - c0[c];
            e[k][c] = c1[3 * k + 3 + c] - c1[c];
            size = size > fabs(r[k][c]) ? size : fabs(r[k][c]);
            size = size > fabs(e[k][c]) ? size : fabs(e[k][c]);
        }
    {
        TOOLS
        for (int k = 0; k < 3; ++k)
            for (int c = 0; c < 3; ++c) y[k][c] = r[k][c];
        { CLOSEST }
        distance = length;
        for (int k = 0; k < 3; ++k)
            for (int c = 0; c < 3; ++c) y[k][c] = r[k][c] + when * (e[k][c] - r[k][c]);
        { CLOSEST }
        if (kind) { weights[0] = 1.0 - wa; weights[1] = wa; weights[2] = wb - 1.0; weights[3] = -wb; }
        else { weights[0] = 1.0; weights[1] = wa + wb - 1.0; weights[2] = -wa; weights[3] = -wb; }
        double l2 = dot(n, n);
        if (length <= 0x1p-40 * size || !(l2 > 0.0)) {
            double p[3], q[3], start[3], moved[3];
            for (int c = 0; c < 3; ++c) {
                p[c] = kind ? y[0][c] : y[1][c] - y[0][c];
                q[c] = kind ? y[2][c] - y[1][c] : y[2][c] - y[0][c];
                start[c] = moved[c] = 0.0;
                for (int k = 0; k < 3; ++k) {
                    start[c] += weights[k + 1] * r[k][c];
                    moved[c] += weights[k + 1] * (e[k][c] - r[k][c]);
                }
            }
            const double none[3] = {0.0, 0.0, 0.0};
            across(p, q, none, n);
            l2 = dot(n, n);
            if (!(l2 > 1e-20 * dot(p, p) * dot(q, q)) || !(l2 > 0.0)) {  // no area, or parallel edges: against the motion
                for (int c = 0; c < 3; ++c) n[c] = -moved[c];
                if (dot(p, p) > 0.0) away(n, p, dot(p, p));
                l2 = dot(n, n);
                if (!(l2 > 0.0)) { n[0] = n[1] = 0.0; n[2] = l2 = 1.0; }
            }
            double side = dot(n, start);
            if (fabs(side) <= 0x1p-40 * size * sqrt(l2)) side = -dot(n, moved);
            if (side < 0.0) for (int c = 0; c < 3; ++c) n[c] = -n[c];
        }
        const double scale = 1.0 / sqrt(l2);
        for (int c = 0; c < 3; ++c) unit_normal[c] = n[c] * scale;
    }
""".replace("TOOLS", TOOLS).replace("CLOSEST", CLOSEST)
