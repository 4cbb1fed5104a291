"""The ready meshes fill what they say they fill, and neighbours fit together."""

import numpy as np
import pytest

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.repair import check_surface, repair_tetrahedra
from turnbuckle.meshes.shapes import boundary_triangles, box_tetrahedra, cylinder_tetrahedra, grid_sheet, six_volumes


@pytest.mark.parametrize("cells", [(1, 1, 1), (2, 3, 4), (5, 1, 2)])
def test_box(cells):
    vertices, tetrahedra = box_tetrahedra((1.0, 2.0, 3.0), cells)
    nx, ny, nz = cells
    assert len(tetrahedra) == 5 * nx * ny * nz and tetrahedra.dtype == np.int32
    assert (six_volumes(vertices, tetrahedra) > 0).all()
    assert six_volumes(vertices, tetrahedra).sum() / 6 == pytest.approx(6.0)
    # Were a diagonal not shared, the two sides of that face would show up in the boundary.
    boundary = boundary_triangles(tetrahedra)
    assert len(boundary) == 4 * (nx * ny + ny * nz + nz * nx)
    report = check_surface(vertices, boundary)[2]
    assert report.flipped == 0 and report.volume == pytest.approx(6.0)
    assert repair_tetrahedra(vertices, tetrahedra)[2].clean
    np.testing.assert_allclose(vertices[1 + (nx + 1) * (1 + (ny + 1) * 1)], [1 / nx, 2 / ny, 3 / nz])


@pytest.mark.parametrize(("around", "along"), [(3, 1), (8, 5), (13, 2)])
def test_cylinder(around, along):
    vertices, tetrahedra = cylinder_tetrahedra(0.5, 2.0, around, along)
    prism = 0.5 * around * 0.25 * np.sin(2 * np.pi / around) * 2.0
    assert six_volumes(vertices, tetrahedra).min() > 0
    assert six_volumes(vertices, tetrahedra).sum() / 6 == pytest.approx(prism)
    report = check_surface(vertices, boundary_triangles(tetrahedra))[2]
    assert len(boundary_triangles(tetrahedra)) == 2 * around + 2 * around * along
    assert report.flipped == 0 and report.volume == pytest.approx(prism)


def test_sheet():
    sheet = grid_sheet((2.0, 1.0), (4, 2))
    assert len(sheet.vertices) == 15 and len(sheet.triangles) == 16
    a, b, c = (sheet.vertices[sheet.triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    assert (normals[:, 2] > 0).all() and normals[:, 2].sum() / 2 == pytest.approx(2.0)
    lengths = {name: np.linalg.norm(np.diff(sheet.vertices[getattr(sheet, name)], axis=1)[:, 0], axis=1) for name in ("structural", "shear", "bend")}  # fmt: skip
    assert len(lengths["structural"]) == 4 * 3 + 5 * 2 and np.allclose(lengths["structural"], 0.5)
    assert len(lengths["shear"]) == 2 * 8 and np.allclose(lengths["shear"], 0.5 * np.sqrt(2))
    assert len(lengths["bend"]) == 3 * 3 + 5 * 1 and np.allclose(lengths["bend"], 1.0)
    edges = {tuple(sorted(e)) for t in sheet.triangles.tolist() for e in (t[:2], t[1:], t[::2])}
    assert edges <= {tuple(sorted(e)) for e in np.concatenate([sheet.structural, sheet.shear]).tolist()}


def test_wrong_sizes_are_refused():
    for call in (
        lambda: box_tetrahedra((1, -1, 1), (1, 1, 1)),
        lambda: box_tetrahedra((1, 1, 1), (0, 1, 1)),
        lambda: grid_sheet((1, np.nan), (1, 1)),
        lambda: cylinder_tetrahedra(1, 1, 2, 1),
    ):
        with pytest.raises(InputError):
            call()
