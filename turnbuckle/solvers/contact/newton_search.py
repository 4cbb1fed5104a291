"""The length of a Newton step: where the augmented Lagrangian is least along it.

With ``phi(t)`` the Lagrangian at ``v + t dv`` and ``du = J dv``,

    phi'(t) = dv . (g + J^T r) + t dv . A dv - sum r(t) . du,    phi''(t) = dv . A dv + sum du . D(t) du,

and phi is convex: its derivative grows. Where conjugate gradients end with a residual e, ``H dv = -g - e``, so
``dv . A dv = -dv . (g + e) - sum du . D du`` costs no product with A. Only contacts are looked at for each t.
"""

from collections.abc import Callable

import numpy as np
import warp as wp

from turnbuckle.math.types import real
from turnbuckle.solvers.contact.newton_kernels import cone_derivative, on_cone, place, relative_to

wp.set_module_options({"enable_backward": False})

SUMS = 4  # rows of the sums below
GOOD = 0.2  # part of the first slope that may be left
LOOKS = 12
FAR = 4.0  # times a length, to the next one


@wp.kernel
def slopes(begin: int, tiles: int, sizes: wp.array(dtype=int), of_blocks: int, of_contacts: int,
           which_blocks: wp.array(dtype=int), which: wp.array(dtype=int), offsets: wp.array(dtype=int), columns: wp.array(dtype=int),
           j: wp.array(dtype=wp.mat33d), dv: wp.array(dtype=wp.vec3d), g: wp.array(dtype=wp.vec3d),
           residual: wp.array(dtype=wp.vec3d), r: wp.array(dtype=wp.vec3d), d: wp.array(dtype=wp.mat33d),
           du_out: wp.array(dtype=wp.vec3d), sums_out: wp.array2d(dtype=real)):  # fmt: skip
    """du, and by tiles: dv . g, dv . e, sum r . du, sum du . D du."""
    tile = begin + wp.tid()
    along_g = real(0.0)
    along_e = real(0.0)
    for t in range(place(tile, tiles, sizes[of_blocks]), place(tile + 1, tiles, sizes[of_blocks])):
        i = which_blocks[t]
        along_g += wp.dot(dv[i], g[i])
        along_e += wp.dot(dv[i], residual[i])
    push = real(0.0)
    bend = real(0.0)
    for t in range(place(tile, tiles, sizes[of_contacts]), place(tile + 1, tiles, sizes[of_contacts])):
        c = which[t]
        relative_to(c, offsets, columns, j, dv, du_out)
        u = du_out[c]
        push += wp.dot(r[c], u)
        bend += wp.dot(u, d[c] * u)
    sums_out[0, tile] = along_g
    sums_out[1, tile] = along_e
    sums_out[2, tile] = push
    sums_out[3, tile] = bend


@wp.kernel
def along(begin: int, tiles: int, sizes: wp.array(dtype=int), of: int, which: wp.array(dtype=int), length: wp.array(dtype=real), u: wp.array(dtype=wp.vec3d),
          du: wp.array(dtype=wp.vec3d), floor: wp.array(dtype=real), mu: wp.array(dtype=real), rho: wp.array(dtype=real),
          shift: wp.array(dtype=real), multiplier: wp.array(dtype=wp.vec3d), sums_out: wp.array2d(dtype=real)):  # fmt: skip
    """By tiles: sum r(t) . du and sum du . D(t) du at ``t = length``."""
    tile = begin + wp.tid()
    push = real(0.0)
    bend = real(0.0)
    for t in range(place(tile, tiles, sizes[of]), place(tile + 1, tiles, sizes[of])):
        c = which[t]
        w = u[c] + length[0] * du[c]
        s = multiplier[c] - rho[c] * wp.vec3d(w[0] - floor[c] + shift[c], w[1], w[2])
        if mu[c] * wp.sqrt(s[1] * s[1] + s[2] * s[2]) > -s[0]:
            push += wp.dot(on_cone(s, mu[c]), du[c])
            bend += rho[c] * wp.dot(du[c], cone_derivative(s, mu[c]) * du[c])
    sums_out[2, tile] = push
    sums_out[3, tile] = bend


def best_length(sums: np.ndarray, look: Callable[[float], np.ndarray]) -> float:
    """The length t at which phi'(t) is at most a part of what it was at 0.

    ``sums`` (4, tiles) of `slopes`; ``look(t)`` gives them with the last two rows of `along`.
    """
    along_g, along_e, push, bend = (float(x) for x in sums.sum(axis=1))
    linear, square = along_g + push, max(-along_g - along_e - bend, 0.0)
    enough = GOOD * abs(along_g)
    low, high, t = 0.0, np.inf, 1.0
    for _ in range(LOOKS):
        _, _, push, bend = look(t).sum(axis=1)
        slope = linear + t * square - push
        if abs(slope) <= enough:
            break
        low, high = (t, high) if slope < 0.0 else (low, t)
        curve = square + bend
        t = t - slope / curve if curve > 0.0 else 0.5 * t
        if not low < t < high:
            t = 0.5 * (low + high) if high < np.inf else FAR * low
        t = min(t, FAR * max(low, 1.0))
    return t
