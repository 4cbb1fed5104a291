"""Pictures show the bodies where they are, in their colours, on both engines; films hold their frames."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from turnbuckle.data.errors import InputError
from turnbuckle.data.shape import Shape
from turnbuckle.meshes.shapes import boundary_triangles, box_tetrahedra, grid_sheet
from turnbuckle.viewer import Renderer, headless, open_picture
from turnbuckle.viewer.camera import Framing, frame_box
from turnbuckle.viewer.geometry import SceneGeometry, split_creases

ROOT = Path(__file__).parents[1]
SIZE = (320, 180)
RED, BLUE = (0.85, 0.15, 0.1), (0.1, 0.2, 0.85)


def _scene():
    """A red cube on the left, a blue cube on the right, a rope above."""
    vertices, tetrahedra = box_tetrahedra((1, 1, 1), (1, 1, 1))
    rope = np.stack([np.linspace(0, 4, 9), np.full(9, 0.5), np.full(9, 1.5)], axis=1)
    lines = np.stack([np.arange(8), np.arange(1, 9)], axis=1).astype(np.int32)
    shapes = [
        Shape("left", 0, 8, triangles=boundary_triangles(tetrahedra), tetrahedra=tetrahedra, color=RED),
        Shape("right", 8, 16, triangles=boundary_triangles(tetrahedra), tetrahedra=tetrahedra, color=BLUE),
        Shape("rope", 16, 25, lines=lines, color=(0.1, 0.6, 0.1)),
    ]
    return shapes, np.concatenate([vertices, vertices + [3, 0, 0], rope])


def _engines():
    missing = isinstance(headless.start(), str)
    return [pytest.param("polyscope", marks=pytest.mark.skipif(missing, reason="no headless OpenGL here")), "pillow"]


def _where(picture, channel):
    """Mean pixel (x, y) of what is clearly of one colour, and how many pixels are."""
    others = [c for c in range(3) if c != channel]
    values = picture.astype(int)
    mask = values[..., channel] > values[..., others].max(axis=-1) + 40
    rows, columns = np.nonzero(mask)
    return (columns.mean(), rows.mean()) if len(rows) else (np.nan, np.nan), len(rows)


@pytest.mark.parametrize("engine", _engines())
def test_bodies_are_where_the_camera_projects_them(engine):
    shapes, x = _scene()
    renderer = Renderer(shapes, "Z", SIZE, engine=engine)
    picture = renderer.frame(x)
    assert renderer.engine == engine
    assert picture.shape == (180, 320, 3) and picture.dtype == np.uint8
    camera = Framing("Z", SIZE, None).follow(x)
    for channel, centre in ((0, (0.5, 0.5, 0.5)), (2, (3.5, 0.5, 0.5))):
        place, count = _where(picture, channel)
        assert count > 300
        np.testing.assert_allclose(place, camera.project(np.array([centre]), SIZE)[0][0], atol=8)
    assert _where(picture, 1)[1] > 20  # the rope
    background = picture[2, 2].astype(int)
    assert background.min() > 225  # light


@pytest.mark.parametrize("engine", _engines())
def test_motion_shows_and_a_fixed_camera_stays(engine):
    shapes, x = _scene()
    renderer = Renderer(shapes, "Z", SIZE, bounds=(np.array([-1, -1, -1]), np.array([6, 2, 4])), engine=engine)
    first = renderer.frame(x)
    moved = x.copy()
    moved[8:16] += [0, 0, 2]
    second = renderer.frame(moved)
    assert _where(second, 2)[0][1] < _where(first, 2)[0][1] - 15  # up
    np.testing.assert_allclose(_where(second, 0)[0], _where(first, 0)[0], atol=0.5)
    np.testing.assert_array_equal(renderer.frame(x), first)


@pytest.mark.parametrize("engine", _engines())
def test_two_renderers_take_turns(engine):
    shapes, x = _scene()
    one = Renderer(shapes[:1], "Z", SIZE, engine=engine)
    two = Renderer(shapes[1:], "Y", (200, 200), engine=engine)
    a, b = one.frame(x), two.frame(x)
    for again, before in ((one.frame(x), a), (two.frame(x), b)):  # a few pixels at edges may round differently
        assert (np.abs(again.astype(int) - before) > 8).any(axis=-1).mean() < 0.003
    assert _where(a, 2)[1] == 0 and _where(b, 0)[1] == 0
    assert b.shape == (200, 200, 3)


@pytest.mark.parametrize("engine", _engines())
def test_title_skin_and_nothing_to_see(engine):
    shapes, x = _scene()
    renderer = Renderer(shapes, "Z", SIZE, engine=engine)
    plain, titled = renderer.frame(x), renderer.frame(x, "t = 1 s")
    assert (plain != titled).any() and (plain[60:] == titled[60:]).all()
    assert Renderer([], "Z", SIZE, engine=engine).frame(np.zeros((0, 3))).shape == (180, 320, 3)
    assert Renderer(shapes, "Z", SIZE, engine=engine).frame(np.where(np.arange(25)[:, None] == 3, np.nan, x)).any()


@pytest.mark.parametrize("up_axis", ["Y", "Z"])
@pytest.mark.parametrize("size", [(1280, 720), (300, 900)])
def test_camera_holds_the_box_and_fills_the_picture(up_axis, size):
    rng = np.random.default_rng(2)
    for _ in range(20):
        low = rng.normal(size=3)
        high = low + rng.uniform(0.01, 3, size=3)
        camera = frame_box(low, high, up_axis, size)
        corners = np.array([[(low, high)[b >> k & 1][k] for k in range(3)] for b in range(8)])
        pixels, depth = camera.project(corners, size)
        assert (depth > 0).all() and (pixels > 0).all() and (pixels < size).all()
        margins = np.concatenate([pixels.min(axis=0), np.array(size) - pixels.max(axis=0)]) / np.tile(size, 2)
        assert margins.min() < 0.07  # one direction is used to the full
        np.testing.assert_allclose(margins[:2], margins[2:], atol=1e-6)  # and all is in the middle
        up = np.array([0, 1.0, 0]) if up_axis == "Y" else np.array([0, 0, 1.0])
        ends = camera.project(np.array([(low + high) / 2, (low + high) / 2 + 0.01 * up]), size)[0]
        assert ends[1, 1] < ends[0, 1] and abs(ends[1, 0] - ends[0, 0]) < 0.2 * (ends[0, 1] - ends[1, 1])


def test_camera_follows_what_moves_away():
    framing = Framing("Z", SIZE, None)
    points = np.random.default_rng(0).uniform(size=(20, 3))
    for step in range(60):
        camera = framing.follow(points + [0, 0, -0.2 * min(step, 20)])
    pixels, _ = camera.project(points + [0, 0, -4.0], SIZE)
    assert (pixels > 0).all() and (pixels < SIZE).all()


def test_creases_are_split_and_curves_are_not():
    vertices, tetrahedra = box_tetrahedra((1, 1, 1), (2, 2, 2))
    cells, old = split_creases(vertices, boundary_triangles(tetrahedra))
    assert len(old) == 6 * 9  # each side of the cube has vertices of its own
    np.testing.assert_array_equal(old[cells], boundary_triangles(tetrahedra))
    sheet = grid_sheet((1, 1), (6, 6))
    bent = sheet.vertices + np.stack([0 * sheet.vertices[:, 0]] * 2 + [0.2 * sheet.vertices[:, 0] ** 2], axis=1)
    assert len(split_creases(bent, sheet.triangles)[1]) == 49
    assert len(SceneGeometry(_scene()[0], _scene()[1]).surface.cells) == 24


@pytest.mark.parametrize("suffix", [".png", ".gif", ".mp4"])
def test_films(tmp_path, suffix):
    if suffix == ".mp4":
        pytest.importorskip("imageio_ffmpeg")
    shapes, x = _scene()
    path = tmp_path / f"film{suffix}"
    with open_picture(path, shapes, up_axis="Z", frames_per_second=25, size=(161, 91), engine="pillow") as recorder:
        for frame in range(6):
            recorder.write(frame / 25, x + [0, 0, 0.2 * frame], 0 * x)
        recorder.flush()
    recorder.close()
    with pytest.raises(InputError, match="closed"):
        recorder.write(1.0, x, x)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    if suffix == ".png":
        assert Image.open(path).size == (161, 91)
    elif suffix == ".gif":
        film = Image.open(path)
        assert (film.n_frames, film.size) == (6, (161, 91))
        shown, total = [], 0
        for frame in range(6):
            film.seek(frame)
            total += film.info["duration"]
            shown.append(np.asarray(film.convert("RGB")).astype(int))
        assert total == 240
        assert all((abs(a - b) > 30).any() for a, b in zip(shown, shown[1:], strict=False))
    else:
        import imageio_ffmpeg

        frames = imageio_ffmpeg.read_frames(str(path))
        meta = next(frames)
        assert meta["size"] == (160, 90) and meta["fps"] == 25 and len(list(frames)) == 6


def test_numbered_pictures_and_last_picture_on_flush(tmp_path):
    shapes, x = _scene()
    settings = {"up_axis": "Z", "frames_per_second": 10, "size": (64, 48), "engine": "pillow"}
    with open_picture(tmp_path / "p_%03d.png", shapes, **settings) as recorder:
        for frame in range(3):
            recorder.write(frame / 10, x, x)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["p_000.png", "p_001.png", "p_002.png"]
    recorder = open_picture(tmp_path / "last.png", shapes, **settings)
    recorder.write(0.0, x, x)
    assert not (tmp_path / "last.png").exists()
    recorder.flush()
    assert (tmp_path / "last.png").exists()


def test_wrong_arguments(tmp_path, monkeypatch):
    shapes, _ = _scene()
    settings = {"up_axis": "Z", "frames_per_second": 10.0}
    for name, more, words in (
        ("a.bmp", {}, r"\.png, \.gif, \.mp4"),
        ("no/a.png", {}, "no folder"),
        ("a.png", {"up_axis": "X"}, "up_axis"),
        ("a.png", {"size": (3, 3)}, "size"),
        ("a.gif", {"frames_per_second": 0.0}, "frames_per_second"),
        ("a.png", {"engine": "crayon"}, "crayon"),
    ):
        with pytest.raises(InputError, match=words):
            open_picture(tmp_path / name, shapes, **(settings | more))
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(InputError, match=r"turnbuckle\[film\]"):
        open_picture(tmp_path / "a.mp4", shapes, **settings)


_SCRIPT = """
import os, sys
import numpy as np
from turnbuckle.data.shape import Shape
from turnbuckle.viewer import open_picture
x = np.random.default_rng(0).normal(size=(10, 3))
shapes = [Shape("rope", 0, 10, lines=np.stack([np.arange(9), np.arange(1, 10)], 1).astype(np.int32))]
recorder = open_picture(sys.argv[1], shapes, up_axis="Z", frames_per_second=5, size=(64, 48), engine=sys.argv[2])
for frame in range(12):
    recorder.write(frame / 5, x + frame, x)
print(recorder.renderer.engine, recorder.note, flush=True)
recorder.flush()
os._exit(9) if sys.argv[3] == "kill" else recorder.close()
"""


def _run(*arguments, **environment):
    return subprocess.run(
        [sys.executable, "-c", _SCRIPT, *map(str, arguments)],
        cwd=ROOT, env=os.environ | environment, capture_output=True, text=True, timeout=60,
    )  # fmt: skip


def test_without_egl_the_picture_is_drawn_and_the_package_named(tmp_path):
    done = _run(tmp_path / "a.png", "auto", "close", __EGL_VENDOR_LIBRARY_DIRS="/nonexistent")
    assert done.returncode == 0, done.stderr
    if "polyscope None" in done.stdout:
        pytest.skip("this machine finds EGL elsewhere")
    assert "pillow" in done.stdout and "libegl1" in done.stdout
    assert "Exception ignored" not in done.stderr
    assert Image.open(tmp_path / "a.png").size == (64, 48)


@pytest.mark.parametrize("suffix", [".gif", ".mp4"])
def test_killed_film_shows_what_was_flushed(tmp_path, suffix):
    if suffix == ".mp4":
        imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    path = tmp_path / f"film{suffix}"
    assert _run(path, "pillow", "kill").returncode == 9
    if suffix == ".gif":
        assert Image.open(path).n_frames == 12
    else:
        frames = imageio_ffmpeg.read_frames(str(path))
        next(frames)
        assert len(list(frames)) >= 10


def test_a_single_picture_shows_what_has_moved_away(tmp_path):
    """The camera of the last frame alone is not held back by where the scene began, nor by frames flushed between."""
    shapes, x = _scene()
    target = tmp_path / "last.png"
    with open_picture(
        target, shapes, up_axis="Z", frames_per_second=30, size=SIZE, title=False, engine="pillow"
    ) as out:
        for k in range(3):
            out.write(0.1 * k, x + [20.0 * k, 0, 0], np.zeros_like(x))
            out.flush()
    far = np.asarray(Image.open(target).convert("RGB"))
    assert np.array_equal(far, Renderer(shapes, "Z", SIZE, engine="pillow").frame(x + [40.0, 0, 0]))
    assert _where(far, 0)[1] > 500 and _where(far, 2)[1] > 500


def test_bodies_stand_on_their_shadows():
    _, x = _scene()
    camera = Framing("Z", SIZE, None).follow(x)
    assert camera.low[2] == x[:, 2].min() and camera.low[0] < x[:, 0].min() and camera.high[2] > x[:, 2].max()


def test_pictures_may_be_asked_for_by_any_thread() -> None:
    shapes, x = _scene()
    pictures = [Renderer(shapes, "Z", size=(64, 48)).frame(x)]
    other = threading.Thread(target=lambda: pictures.append(Renderer(shapes, "Z", size=(64, 48)).frame(x)))
    other.start()
    other.join()
    pictures.append(Renderer(shapes, "Z", size=(64, 48)).frame(x))
    assert len(pictures) == 3
    for picture in pictures[1:]:  # a software renderer may round a pixel another way on another thread
        assert np.abs(picture.astype(int) - pictures[0]).mean() < 0.5
