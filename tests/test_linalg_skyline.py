"""Cholesky factors of the parts of a block matrix against dense solutions."""

import numpy as np
import pytest
import scipy.sparse as sp
import warp as wp

from turnbuckle.linalg.skyline import SkylineFactors, factor_parts, find_parts, solve_parts


def parts_matrix(sizes, rng):
    """Random positive definite blocks in several unconnected parts, blocks in a random order."""
    n = sum(sizes)
    name = rng.permutation(n)
    rows, columns = [np.arange(n)], [np.arange(n)]
    begin = 0
    for size in sizes:
        if size > 1:
            a = np.arange(1, size)
            b = rng.integers(0, a)
            more = rng.integers(0, size, (size, 2))
            more = more[more[:, 0] != more[:, 1]]
            i, j = begin + np.r_[a, more[:, 0]], begin + np.r_[b, more[:, 1]]
            rows += [name[i], name[j]]
            columns += [name[j], name[i]]
        begin += size
    pattern = sp.csr_array(
        (np.ones(len(np.concatenate(rows))), (np.concatenate(rows), np.concatenate(columns))), shape=(n, n)
    )
    values = np.zeros((3 * n, 3 * n))
    for i, j in zip(*pattern.nonzero(), strict=True):
        if i < j:
            block = rng.normal(size=(3, 3))
            values[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] = block
            values[3 * j : 3 * j + 3, 3 * i : 3 * i + 3] = block.T
    values += np.diag(np.abs(values).sum(axis=1) + 1.0)
    return sp.bsr_array(values, blocksize=(3, 3)), values


@pytest.mark.parametrize("nailed", [False, True])
def test_parts_are_solved(nailed):
    rng = np.random.default_rng(5)
    a, dense = parts_matrix([7, 1, 30, 2, 60], rng)
    n = dense.shape[0] // 3
    fixed = np.zeros(n, dtype=np.uint8)
    if nailed:
        fixed[rng.integers(0, n, 12)] = 1
    parts = find_parts(a.indptr, a.indices, np.zeros(n, dtype=bool))
    assert parts.count == 4  # a block alone needs no factor
    factors = SkylineFactors(parts, "cpu")
    put = lambda values, kind: wp.array(np.ascontiguousarray(values), dtype=kind, device="cpu")  # noqa: E731
    r = rng.normal(size=(n, 3))
    z = wp.zeros(n, dtype=wp.vec3d, device="cpu")
    held = put(fixed, wp.uint8)
    go = wp.zeros(1, dtype=wp.float64, device="cpu")
    more = np.zeros((n, 3, 3))  # on the diagonal
    more[::3] = 2.0 * np.eye(3)
    dense = dense + np.kron(np.diag(more[:, 0, 0]), np.eye(3))
    diagonal = np.stack([dense[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] for i in range(n)])
    given = [put(a.indptr, wp.int32), put(a.indices, wp.int32), put(a.data, wp.mat33d), put(diagonal, wp.mat33d), held]
    wp.launch(factor_parts, parts.count, inputs=[0, *factors.factor_inputs(*given)], device="cpu")
    wp.launch(solve_parts, parts.count, inputs=[0, *factors.solve_inputs(held, put(r, wp.vec3d), z, go)], device="cpu")
    free = np.repeat(fixed == 0, 3)
    wanted = np.zeros(3 * n)
    wanted[free] = np.linalg.solve(dense[free][:, free], r.ravel()[free])
    inside = parts.local >= 0
    np.testing.assert_allclose(z.numpy()[inside], wanted.reshape(-1, 3)[inside], rtol=1e-5, atol=1e-7)  # a preconditioner: single precision
    assert (z.numpy()[~inside] == 0.0).all()


def test_parts_that_are_left_out_or_too_large():
    rng = np.random.default_rng(6)
    a, dense = parts_matrix([10, 300], rng)
    left_out = np.zeros(dense.shape[0] // 3, dtype=bool)
    parts = find_parts(a.indptr, a.indices, left_out)
    assert parts.count == 1 and len(parts.nodes) == 10
    left_out[parts.nodes[3]] = True
    assert find_parts(a.indptr, a.indices, left_out).count == 0
