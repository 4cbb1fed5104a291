"""Surfaces filled with tetrahedra, and the store of results."""

import importlib.util

import numpy as np
import pytest

from turnbuckle.data.errors import InputError
from turnbuckle.meshes import tetrahedralise as module
from turnbuckle.meshes.shapes import boundary_triangles, box_tetrahedra, six_volumes
from turnbuckle.meshes.tetrahedralise import cache_folder, tetrahedralise


@pytest.fixture
def surface(tmp_path, monkeypatch):
    monkeypatch.setenv("TURNBUCKLE_CACHE", str(tmp_path / "cache"))
    vertices, tetrahedra = box_tetrahedra((0.2, 0.1, 0.1), (2, 1, 1))
    return vertices + 100.0, boundary_triangles(tetrahedra)


def test_fills_the_surface_and_remembers(surface, capfd, monkeypatch):
    if importlib.util.find_spec("pytetwild") is None:
        pytest.skip("needs pytetwild")
    vertices, tetrahedra = tetrahedralise(*surface, edge_length=0.06, epsilon=0.001)
    assert (six_volumes(vertices, tetrahedra) > 0).all() and tetrahedra.dtype == np.int32
    assert six_volumes(vertices, tetrahedra).sum() / 6 == pytest.approx(0.002, rel=0.05)
    assert capfd.readouterr().out == ""
    (stored,) = cache_folder().iterdir()
    monkeypatch.setattr(module, "_run_library", lambda *_: pytest.fail("the store was not used"))
    again = tetrahedralise(*surface, edge_length=0.06, epsilon=0.001)
    np.testing.assert_array_equal(again[0], vertices)
    np.testing.assert_array_equal(again[1], tetrahedra)


def _instead_of_the_library(monkeypatch):
    calls = []

    def run(vertices, triangles, edge, epsilon):
        calls.append((edge, epsilon))
        return box_tetrahedra((0.5, 0.5, 0.5), (1, 1, 1))

    monkeypatch.setattr(module, "_run_library", run)
    return calls


def test_damaged_store_is_made_anew(surface, monkeypatch):
    calls = _instead_of_the_library(monkeypatch)
    first = tetrahedralise(*surface)
    (stored,) = cache_folder().iterdir()
    whole = stored.read_bytes()
    for damage in (whole[: len(whole) // 2], b"", b"not a zip at all"):
        stored.write_bytes(damage)
        np.testing.assert_array_equal(tetrahedralise(*surface)[1], first[1])
        assert stored.read_bytes() != damage
    assert len(calls) == 4


def test_settings_and_content_are_in_the_key(surface, monkeypatch):
    calls = _instead_of_the_library(monkeypatch)
    vertices, triangles = surface
    tetrahedralise(vertices, triangles)
    tetrahedralise(vertices, triangles, edge_length=0.01)
    tetrahedralise(vertices, triangles, epsilon=0.001)
    tetrahedralise(vertices * 1.5, triangles)
    assert len(calls) == 4 and len(list(cache_folder().iterdir())) == 4


def test_store_that_cannot_be_written_is_no_error(surface, monkeypatch, tmp_path):
    _instead_of_the_library(monkeypatch)
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("TURNBUCKLE_CACHE", str(tmp_path / "file"))
    assert len(tetrahedralise(*surface)[1]) == 5


def test_cache_folder_follows_the_environment(monkeypatch, tmp_path):
    monkeypatch.delenv("TURNBUCKLE_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "turnbuckle"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache_folder().parts[-2:] == (".cache", "turnbuckle")


def test_wrong_input_is_refused(surface, monkeypatch):
    vertices, triangles = surface
    with pytest.raises(InputError, match="not closed"):
        tetrahedralise(vertices, triangles[1:])
    with pytest.raises(InputError, match="edge_length"):
        tetrahedralise(vertices, triangles, edge_length=-1)
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *a: None if name == "pytetwild" else found(name, *a))
    with pytest.raises(InputError, match=r"turnbuckle\[tet\]"):
        tetrahedralise(vertices, triangles)
