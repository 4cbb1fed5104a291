"""The problem of one contact, all others held: C text that the solvers' kernels share (the same for CPU and CUDA).

With the velocity ``u = W r + b`` (W: 3 x 3, n first; b_n less the floor) find r with

    0 <= r_n  complementary to  u_n >= 0,    r_t in the section of radius mu r_n and opposed to u_t.

**The cone, exactly.** Apart when b_n >= 0. Else r_n = -(b_n + W_nt r_t) / W_nn, which leaves ``S r_t - c = u_t`` with
``S = W_tt - W_tn W_nt / W_nn``, ``c = W_tn b_n / W_nn - b_t``. Sticking: u_t = 0, if inside. Sliding: u_t = -s r_t, s > 0,
thus ``r_t(s) = (S + s)^-1 c`` where ``f(s) = |r_t| - mu r_n`` is zero. f(0) > 0, since it does not stick, and f is negative
for large s, where r_n tends to -b_n / W_nn > 0: there is a root, found by Newton's method in a shrinking bracket that starts
from the s of the last impulse.

**Polygons** (sides > 0): normal and tangential part in turn, three times (Contact, 5.5). The tangential part with r_n given
is a convex quadratic function on the section: its minimum is free, or on a face, where it is a clamp; the four-sided one is
the paper's two clamps.
"""

# defines: one_contact(const double *w, const double *b, double mu, int sides, double ax, double ay, double *r)
SOLVE_ONE_CONTACT = """
    auto one_contact = [](const double *w, const double *b, double mu, int sides, double ax, double ay, double *r) {
        if (!(w[0] > 0.0)) { r[0] = r[1] = r[2] = 0.0; return; }
        if (mu <= 0.0) { r[0] = b[0] < 0.0 ? -b[0] / w[0] : 0.0; r[1] = r[2] = 0.0; return; }
        if (sides == 0) {
            if (b[0] >= 0.0) { r[0] = r[1] = r[2] = 0.0; return; }
            const double wn = 1.0 / w[0], w1 = w[1], w2 = w[2];
            const double s11 = w[4] - w1 * w1 * wn, s12 = w[5] - w1 * w2 * wn, s22 = w[8] - w2 * w2 * wn;
            const double c1 = w1 * b[0] * wn - b[1], c2 = w2 * b[0] * wn - b[2];
            const double trace = s11 + s22, size = sqrt(c1 * c1 + c2 * c2);
            double x = 0.0, y = 0.0, n = -b[0] * wn, s = 0.0, low = 0.0, high = -1.0, len = 0.0;
            bool last = false;
            if (size > 0.0) {
                double det = s11 * s22 - s12 * s12;
                if (det > 1e-14 * trace * trace) {
                    x = (s22 * c1 - s12 * c2) / det; y = (s11 * c2 - s12 * c1) / det;
                    n = -(b[0] + w1 * x + w2 * y) * wn;
                    if (x * x + y * y <= mu * mu * n * n && n >= 0.0) { r[0] = n; r[1] = x; r[2] = y; return; }
                }
                const double before = sqrt(r[1] * r[1] + r[2] * r[2]);
                const double ux = b[1] + w[3] * r[0] + w[4] * r[1] + w[5] * r[2];
                const double uy = b[2] + w[6] * r[0] + w[7] * r[1] + w[8] * r[2];
                s = before > 0.0 ? sqrt(ux * ux + uy * uy) / before : 0.0;
                if (!(s > 1e-12 * trace && s < 1e12 * trace)) s = size / (mu * (-b[0] * wn));
                for (int step = 0; step < 100; ++step) {
                    const double d11 = s11 + s, d22 = s22 + s;
                    det = 1.0 / (d11 * d22 - s12 * s12);
                    x = (d22 * c1 - s12 * c2) * det; y = (d11 * c2 - s12 * c1) * det;
                    n = -(b[0] + w1 * x + w2 * y) * wn;
                    len = sqrt(x * x + y * y);
                    const double f = len - mu * n;
                    if (f > 0.0) low = s; else high = s;
                    const double size_f = len + mu * fabs(n);
                    if (last || fabs(f) <= 1e-15 * size_f) break;
                    last = fabs(f) <= 1e-5 * size_f;  // one more step, which squares it; the next visit starts from there
                    const double dx = -(d22 * x - s12 * y) * det, dy = -(d11 * y - s12 * x) * det;
                    const double slope = x * dx + y * dy + len * mu * wn * (w1 * dx + w2 * dy);  // f' times |r_t|
                    // Newton's method on 1 / |r_t| - 1 / (mu r_n), which runs almost straight where r_n changes little
                    double next = n > 0.0 ? s - f * len * len / (slope * mu * n) : s - f * len / slope;
                    const double end = high > 0.0 ? high : 16.0 * s;
                    if (!(next > low && next < end)) next = high > 0.0 ? 0.5 * (low + high) : 4.0 * s;
                    if (next == s || (high > 0.0 && high - low <= 1e-16 * high)) break;
                    s = next;
                }
                // on the cone exactly: the normal part is that of the tangential one, which is cut or stretched to it
                if (!(n > 0.0) || len == 0.0) { x = y = 0.0; n = -b[0] * wn; }
                else { const double cut = mu * n / len; if (cut < 1.0) { x *= cut; y *= cut; } }
            }
            r[0] = n; r[1] = x; r[2] = y;
            return;
        }
        // polygons: in the axes of the section
        const double w1 = w[1] * ax + w[2] * ay, w2 = w[2] * ax - w[1] * ay;
        const double t11 = (w[4] * ax + w[5] * ay) * ax + (w[5] * ax + w[8] * ay) * ay;
        const double t12 = (w[5] * ax - w[4] * ay) * ax + (w[8] * ax - w[5] * ay) * ay;
        const double t22 = (w[8] * ax - w[5] * ay) * ax - (w[5] * ax - w[4] * ay) * ay;
        const double b1 = b[1] * ax + b[2] * ay, b2 = b[2] * ax - b[1] * ay;
        double x = r[1] * ax + r[2] * ay, y = r[2] * ax - r[1] * ay, n = r[0];
        for (int turn = 0; turn < 3; ++turn) {
            n = -(b[0] + w1 * x + w2 * y) / w[0];
            if (!(n > 0.0)) { n = x = y = 0.0; continue; }
            const double radius = mu * n;
            if (sides == 4) {
                if (t11 > 0.0) x = -(b1 + w1 * n + t12 * y) / t11;
                x = x > radius ? radius : (x < -radius ? -radius : x);
                if (t22 > 0.0) y = -(b2 + w2 * n + t12 * x) / t22;
                y = y > radius ? radius : (y < -radius ? -radius : y);
                continue;
            }
            const double g1 = b1 + w1 * n, g2 = b2 + w2 * n, det = t11 * t22 - t12 * t12;
            const double half = 3.14159265358979323846 / sides, turn_c = cos(2.0 * half), turn_s = sin(2.0 * half);
            double c = 1.0, s = 0.0, far = radius * tan(half), best = 1e300;
            bool inside = det > 1e-14 * (t11 + t22) * (t11 + t22);
            const double fx = inside ? -(t22 * g1 - t12 * g2) / det : 0.0, fy = inside ? -(t11 * g2 - t12 * g1) / det : 0.0;
            for (int face = 0; face < sides; ++face) {
                if (c * fx + s * fy > radius) inside = false;
                const double px = radius * c, py = radius * s;  // foot of the face, tangent (-s, c)
                const double hx = t11 * px + t12 * py + g1, hy = t12 * px + t22 * py + g2;
                const double bend = (t11 * s - t12 * c) * s - (t12 * s - t22 * c) * c, pull = -s * hx + c * hy;
                double at = bend > 0.0 ? -pull / bend : (pull > 0.0 ? -far : far);
                at = at > far ? far : (at < -far ? -far : at);
                const double qx = px - at * s, qy = py + at * c;
                const double q = 0.5 * (t11 * qx * qx + 2.0 * t12 * qx * qy + t22 * qy * qy) + g1 * qx + g2 * qy;
                if (q < best) { best = q; x = qx; y = qy; }
                const double c_next = c * turn_c - s * turn_s;
                s = s * turn_c + c * turn_s; c = c_next;
            }
            if (inside) { x = fx; y = fy; }
        }
        r[0] = n; r[1] = x * ax - y * ay; r[2] = x * ay + y * ax;
    };
"""
