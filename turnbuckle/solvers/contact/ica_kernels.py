"""The three passes of iterative constraint anticipation, one item each: serial, in native C.

Each Gauss-Seidel sweep uses what the one before it has written, so a pass is one thread's work; its order is that of the
contacts and of the blocks. ``coupling`` is ``D^-1 (L + U)``, so no pass solves anything but the contacts' own 3 x 3 problems.
"""

import warp as wp

from turnbuckle.compute.start import start_warp
from turnbuckle.solvers.contact.one_contact import SOLVE_ONE_CONTACT

start_warp()
wp.set_module_options({"enable_backward": False})

I32 = wp.array(dtype=wp.int32)
F64 = wp.array(dtype=wp.float64)

# What `sweep` reports: sweeps; 2-norms of the normal and tangential residuals of the last one, the largest of either, and
# the largest floor - J_n v [m/s].
SWEEPS, NORMAL, TANGENTIAL, WORST, GAP = range(5)


@wp.func_native(
    """
    double norm = 0.0, worst = 0.0;
    for (int k = 0; k < n; ++k) {
        double t[3] = {free.data[3 * k], free.data[3 * k + 1], free.data[3 * k + 2]};
        const int end = start.data[k + 1];
        for (int e = start.data[k]; e < end; ++e) {
            const double *c = coupling.data + 9 * (long long)e, *d = change.data + 3 * index.data[e];
            t[0] += c[0] * d[0] + c[1] * d[1] + c[2] * d[2];
            t[1] += c[3] * d[0] + c[4] * d[1] + c[5] * d[2];
            t[2] += c[6] * d[0] + c[7] * d[1] + c[8] * d[2];
        }
        for (int a = 0; a < 3; ++a) { base.data[3 * k + a] = t[a]; velocity.data[3 * k + a] = t[a] + pulled.data[3 * k + a]; }
    }
    for (int i = 0; i < m; ++i) {
        const double *r = impulse.data + 3 * i;
        if (r[0] == 0.0) continue;
        for (int e = row.data[i]; e < row.data[i + 1]; ++e) {
            const double *y = response.data + 9 * (long long)e;
            double *v = velocity.data + 3 * block.data[e];
            for (int c = 0; c < 3; ++c) v[c] += y[c] * r[0] + y[3 + c] * r[1] + y[6 + c] * r[2];
        }
    }
    for (int k = 0; k < 3 * n; ++k) {
        const double left = velocity.data[k] - free.data[k] - change.data[k], size = fabs(left);
        norm += left * left;
        if (!(size <= worst)) worst = size;
    }
    info.data[0] = sqrt(norm);
    info.data[1] = worst;
"""
)
def _anticipate(
    n: int, start: I32, index: I32, coupling: F64, m: int, row: I32, block: I32, response: F64, impulse: F64,
    free: F64, change: F64, pulled: F64, base: F64, velocity: F64, info: F64,
): ...  # fmt: skip


@wp.kernel
def anticipate(
    begin: int, n: int, start: I32, index: I32, coupling: F64, m: int, row: I32, block: I32, response: F64, impulse: F64,
    free: F64, change: F64, pulled: F64, base: F64, velocity: F64, info: F64,
):  # fmt: skip
    """``base = v* + D^-1 (L + U) dv``, and ``velocity``: with the impulses of contacts and those ``pulled`` by joints.

    ``velocity - v* - dv`` is ``D^-1`` times the residual of the dynamics: its 2-norm and largest entry go to ``info``.
    """
    _anticipate(
        n, start, index, coupling, m, row, block, response, impulse, free, change, pulled, base, velocity, info
    )  # fmt: skip


@wp.func_native(
    SOLVE_ONE_CONTACT
    + """
    const int most = (int)control.data[0];
    const bool look = control.data[1] != 0.0, paper = control.data[2] != 0.0;
    const double target = control.data[3], allowance = control.data[4];
    double normal_before = -1.0, tangential_before = -1.0;
    int done = 0;
    while (done < most) {
        double normal = 0.0, tangential = 0.0, worst = 0.0, gap = 0.0;
        for (int i = 0; i < m; ++i) {
            const double *w = own.data + 9 * i;
            double *r = impulse.data + 3 * i;
            double u[3] = {-floor.data[i], 0.0, 0.0};
            const int first = row.data[i], end = row.data[i + 1];
            for (int e = first; e < end; ++e) {
                const double *j = jacobian.data + 9 * (long long)e, *v = velocity.data + 3 * block.data[e];
                u[0] += j[0] * v[0] + j[1] * v[1] + j[2] * v[2];
            }
            if (-u[0] > gap) gap = -u[0];
            if (u[0] >= 0.0 && r[0] == 0.0) continue;
            for (int e = first; e < end; ++e) {
                const double *j = jacobian.data + 9 * (long long)e, *v = velocity.data + 3 * block.data[e];
                u[1] += j[3] * v[0] + j[4] * v[1] + j[5] * v[2];
                u[2] += j[6] * v[0] + j[7] * v[1] + j[8] * v[2];
            }
            double next[3] = {r[0], r[1], r[2]};
            for (int a = 0; a < 3; ++a) u[a] -= w[3 * a] * r[0] + w[3 * a + 1] * r[1] + w[3 * a + 2] * r[2];
            one_contact(w, u, friction.data[i], sides, axes.data[2 * i], axes.data[2 * i + 1], next);
            const double d[3] = {next[0] - r[0], next[1] - r[1], next[2] - r[2]};
            for (int a = 0; a < 3; ++a) {
                const double missed = w[3 * a] * d[0] + w[3 * a + 1] * d[1] + w[3 * a + 2] * d[2];
                if (a) tangential += missed * missed; else normal += missed * missed;
                if (!(fabs(missed) <= worst)) worst = fabs(missed);
            }
            if (look) continue;
            for (int a = 0; a < 3; ++a) r[a] = next[a];
            for (int e = first; e < end; ++e) {
                const double *y = response.data + 9 * (long long)e;
                double *v = velocity.data + 3 * block.data[e];
                v[0] += y[0] * d[0] + y[3] * d[1] + y[6] * d[2];
                v[1] += y[1] * d[0] + y[4] * d[1] + y[7] * d[2];
                v[2] += y[2] * d[0] + y[5] * d[1] + y[8] * d[2];
            }
        }
        normal = sqrt(normal); tangential = sqrt(tangential);
        ++done;
        info.data[0] = done; info.data[1] = normal; info.data[2] = tangential; info.data[3] = worst; info.data[4] = gap;
        if (worst <= target || worst != worst) break;
        if (paper && gap <= allowance && fabs(normal - normal_before) <= 0.05 * normal_before
            && fabs(tangential - tangential_before) <= 0.05 * tangential_before) break;
        normal_before = normal; tangential_before = tangential;
    }
"""
)
def _sweep(
    m: int, row: I32, block: I32, jacobian: F64, response: F64, own: F64, floor: F64, friction: F64, axes: F64, sides: int,
    impulse: F64, velocity: F64, control: F64, info: F64,
): ...  # fmt: skip


@wp.kernel
def sweep(
    begin: int, m: int, row: I32, block: I32, jacobian: F64, response: F64, own: F64, floor: F64, friction: F64, axes: F64,
    sides: int, impulse: F64, velocity: F64, control: F64, info: F64,
):  # fmt: skip
    """Projected Gauss-Seidel on ``B = J D^-1 J^T`` (Contact, (11), (13), (14)), by way of the velocities it makes.

    B itself is never needed: its row times the impulses is ``J_i velocity``. Residuals are the velocities that the solution
    of each contact's own problem adds. Stops at ``most`` sweeps; when the largest is at most ``target``; and in the
    ``paper``'s way: both norms change by less than 5 % and no gap closes faster than ``allowance``. ``look``: only measure.
    ``control`` holds most, look, paper, target, allowance, so that the launch can be recorded once.
    """
    _sweep(
        m, row, block, jacobian, response, own, floor, friction, axes, sides, impulse, velocity, control, info
    )  # fmt: skip


@wp.func_native(
    """
    for (int k = 0; k < n; ++k) {
        double t[3];
        for (int a = 0; a < 3; ++a) t[a] = velocity.data[3 * k + a] - base.data[3 * k + a];
        const int end = start.data[k + 1];
        for (int e = start.data[k]; e < end; ++e) {
            const double *c = coupling.data + 9 * (long long)e, *d = change.data + 3 * index.data[e];
            t[0] += c[0] * d[0] + c[1] * d[1] + c[2] * d[2];
            t[1] += c[3] * d[0] + c[4] * d[1] + c[5] * d[2];
            t[2] += c[6] * d[0] + c[7] * d[1] + c[8] * d[2];
        }
        for (int a = 0; a < 3; ++a) change.data[3 * k + a] = t[a];
    }
"""
)
def _refine(n: int, start: I32, index: I32, coupling: F64, base: F64, velocity: F64, change: F64): ...


@wp.kernel
def refine(begin: int, n: int, start: I32, index: I32, coupling: F64, base: F64, velocity: F64, change: F64):
    """One block Gauss-Seidel iteration ``(D - L) dv = U dv + J^T r + ...`` (Contact, (12)), both sides times D^-1."""
    _refine(n, start, index, coupling, base, velocity, change)
