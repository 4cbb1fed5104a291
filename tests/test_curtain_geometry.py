"""The curtain has the paper's counts and touches where it is joined and nowhere else."""

import numpy as np
import pytest

from turnbuckle.data.errors import InputError
from turnbuckle.scenes.curtain_geometry import curtain_geometry


@pytest.mark.parametrize(
    ("m", "cubes", "nails", "pairs"), [(40, 790, 160, 2964), (150, 2990, 600, 11324), (500, 9990, 2000, 37924)]
)
def test_counts_are_the_papers(m: int, cubes: int, nails: int, pairs: int) -> None:
    curtain = curtain_geometry(m)
    assert (curtain.cubes, len(curtain.nails), len(curtain.pairs)) == (cubes, nails, pairs)
    assert len(curtain.tetrahedra) == 5 * cubes
    assert {array.dtype.name for array in curtain[1:]} == {"int32"}


@pytest.mark.parametrize(("m", "rows"), [(2, 1), (2, 2), (3, 5), (7, 20)])
def test_joined_corners_are_exactly_those_that_touch(m: int, rows: int) -> None:
    curtain = curtain_geometry(m, rows, edge=0.13)
    x = curtain.vertices
    assert np.array_equal(x[curtain.pairs[:, 0]], x[curtain.pairs[:, 1]])
    # Every place where corners of two cubes meet is one pair, and each place is met by two cubes at most.
    _, count = np.unique(x, axis=0, return_counts=True)
    assert count.max() <= 2
    assert np.count_nonzero(count == 2) == len(curtain.pairs)
    constrained = np.concatenate([curtain.nails, curtain.pairs.ravel()])
    assert len(np.unique(constrained)) == len(constrained)


def test_tetrahedra_fill_each_cube_once_and_are_not_inverted() -> None:
    edge = 0.2
    curtain = curtain_geometry(3, 4, edge)
    a, b, c, d = np.moveaxis(curtain.vertices[curtain.tetrahedra], 1, 0)
    six_volumes = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)
    assert six_volumes.min() > 0.0
    np.testing.assert_allclose((six_volumes / 6).reshape(-1, 5).sum(axis=1), edge**3, rtol=1e-12)
    assert np.array_equal(curtain.tetrahedra // 8, np.repeat(np.arange(curtain.cubes), 20).reshape(-1, 4))


def test_each_inner_cube_meets_four_others_with_two_corners_each() -> None:
    m, rows = 6, 7
    curtain = curtain_geometry(m, rows)
    cubes, meetings = np.unique(np.sort(curtain.pairs // 8, axis=1), axis=0, return_counts=True)
    assert np.all(meetings == 2)
    degree = np.bincount(cubes.ravel(), minlength=curtain.cubes)
    centre = curtain.vertices.reshape(-1, 8, 3).mean(axis=1)
    inner = (np.abs(centre[:, 0]) < np.abs(centre[:, 0]).max() - 0.15) & (centre[:, 1] < -0.1) & (centre[:, 1] > -0.6)
    assert inner.sum() > 10
    assert np.all(degree[inner] == 4)


def test_it_hangs_from_its_top() -> None:
    curtain = curtain_geometry(4, 6)
    assert np.all(curtain.vertices[curtain.nails, 1] == curtain.vertices[:, 1].max())
    low, high = curtain.vertices.min(axis=0), curtain.vertices.max(axis=0)
    np.testing.assert_allclose(high - low, [0.7, 0.6, 0.1])
    assert high[1] == 0.0
    np.testing.assert_allclose((low + high)[[0, 2]], 0.0, atol=1e-15)


@pytest.mark.parametrize("wrong", [{"m": 1}, {"m": 4, "rows": 0}, {"m": 4, "edge": -1.0}, {"m": 4, "edge": np.nan}])
def test_wrong_input_is_named(wrong: dict) -> None:
    with pytest.raises(InputError, match="curtain: "):
        curtain_geometry(**wrong)
