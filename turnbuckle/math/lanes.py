"""Vector algebra on several items at once.

A *lane* is one item (one tetrahedron, say); a value of type ``scalars`` holds one number for each lane and ``vectors``
one 3-vector for each. On the CPU four lanes fill a SIMD register (measured: 2.4 times faster than one lane, while
eight spill); on the GPU a thread takes one lane. Kernels are written once for either.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from turnbuckle.math.index import known
from turnbuckle.math.types import real, vec3

CPU_LANES = 4
CUDA_LANES = 1

TINY = wp.constant(wp.float64(1e-300))  # keeps a length of zero from dividing zero by zero


@cache
def algebra(width: int) -> SimpleNamespace:
    """Types and device functions for ``width`` lanes."""
    scalars = wp.types.vector(length=width, dtype=wp.float64)

    @wp.struct
    class Vectors:
        x: scalars
        y: scalars
        z: scalars

    @wp.func
    def add(a: Vectors, b: Vectors):
        """a + b."""
        r = Vectors()
        r.x = a.x + b.x
        r.y = a.y + b.y
        r.z = a.z + b.z
        return r

    @wp.func
    def sub(a: Vectors, b: Vectors):
        """a - b."""
        r = Vectors()
        r.x = a.x - b.x
        r.y = a.y - b.y
        r.z = a.z - b.z
        return r

    @wp.func
    def scale(a: Vectors, s: scalars):
        """a s."""
        r = Vectors()
        r.x = wp.cw_mul(a.x, s)
        r.y = wp.cw_mul(a.y, s)
        r.z = wp.cw_mul(a.z, s)
        return r

    @wp.func
    def dot(a: Vectors, b: Vectors):
        """a . b."""
        return wp.cw_mul(a.x, b.x) + wp.cw_mul(a.y, b.y) + wp.cw_mul(a.z, b.z)

    @wp.func
    def cross(a: Vectors, b: Vectors):
        """a x b."""
        r = Vectors()
        r.x = wp.cw_mul(a.y, b.z) - wp.cw_mul(a.z, b.y)
        r.y = wp.cw_mul(a.z, b.x) - wp.cw_mul(a.x, b.z)
        r.z = wp.cw_mul(a.x, b.y) - wp.cw_mul(a.y, b.x)
        return r

    @wp.func
    def length(a: Vectors):
        """|a|, at least 1e-150."""
        squared = dot(a, a)
        r = scalars()
        for lane in range(width):
            r[lane] = wp.sqrt(squared[lane] + TINY)
        return r

    @wp.func
    def total(a: scalars):
        """Sum over the lanes, in their order."""
        r = real(0.0)
        for lane in range(width):
            r += a[lane]
        return r

    @wp.func
    def used(inverse_rest: scalars):
        """1 for a lane whose element is there, 0 for padding (marked by an inverse rest measure of 0)."""
        r = scalars()
        for lane in range(width):
            r[lane] = wp.where(inverse_rest[lane] != real(0.0), real(1.0), real(0.0))
        return r

    @wp.func
    def load(values: wp.array(dtype=vec3), index: wp.array2d(dtype=wp.int32), row: int):
        """``values[index[row, lane]]`` for each lane."""
        r = Vectors()
        for lane in range(width):
            value = values[known(index[row, lane])]
            r.x[lane] = value[0]
            r.y[lane] = value[1]
            r.z[lane] = value[2]
        return r

    @wp.func
    def store(values_out: wp.array(dtype=vec3), first: int, a: Vectors):
        """Write lane k to ``values_out[first + k]``."""
        for lane in range(width):
            values_out[first + lane] = vec3(a.x[lane], a.y[lane], a.z[lane])

    return SimpleNamespace(
        width=width, scalars=scalars, Vectors=Vectors, add=add, sub=sub, scale=scale, dot=dot, cross=cross,
        length=length, total=total, used=used, load=load, store=store,
    )  # fmt: skip
