"""The scalar and vector types of all kernels: float64, since constraints are met to round-off."""

import warp as wp

real = wp.float64
vec3 = wp.vec3d
