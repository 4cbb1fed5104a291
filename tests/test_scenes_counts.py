"""The ready scenes at full size: what the paper counts, and nothing to warn of. Built, not run."""

import inspect
import re
from pathlib import Path

import numpy as np
import pytest

import turnbuckle.scenes
from turnbuckle.data.errors import InputError
from turnbuckle.data.model import Model
from turnbuckle.io.fingerprint import fingerprint
from turnbuckle.scene.check import inspect_scene
from turnbuckle.scene.scene import Scene
from turnbuckle.scenes import REGISTRY

YAML = Path(turnbuckle.scenes.__file__).parent / "yaml"
# No file in the package: their arrays are more than a megabyte, and made in seconds.
TOO_LARGE = {"letters": "1 MB: outlines and cages of 164 letters", "dancer": "43 MB: frames of the dancer, six skirts"}
NAMES = list(REGISTRY)


@pytest.fixture(autouse=True)
def _extras(request: pytest.FixtureRequest) -> None:
    """Letters are made by libraries of the extra `text`."""
    if "letters" in getattr(getattr(request.node, "callspec", None), "params", {}).values():
        pytest.importorskip("manifold3d")
        pytest.importorskip("fontTools")


def count(scene: Scene, when: float = 0.0) -> dict[str, int]:
    """Tetrahedra, and rows of constraints by kind that act at the time `when` [s]."""
    model, state = scene.build()
    counted = {"tetrahedra": len(model.tetrahedra.corners)}
    for group in state.groups.values():
        if group.start <= when < group.end:
            counted[group.kind] = counted.get(group.kind, 0) + len(group.rows)
    return counted


@pytest.mark.parametrize(
    ("m", "tetrahedra", "nails", "pairs"),
    [(40, 3950, 160, 2964), (150, 14950, 600, 11324), (500, 49950, 2000, 37924)],
)
def test_curtain(m: int, tetrahedra: int, nails: int, pairs: int) -> None:
    wanted = {"tetrahedra": tetrahedra, "nail": nails, "points_to_point": pairs}
    assert count(REGISTRY["curtain"](m=m)) == wanted


def test_robot_on_ropes() -> None:
    counted = count(REGISTRY["robot_on_ropes"]())
    nails = counted.pop("nail")
    assert counted == {"tetrahedra": 1339, "points_to_point": 14, "slide": 2}
    assert nails == 2 * 2 * 7  # both ends of both ropes


def test_net_to_bridge() -> None:
    scene = REGISTRY["net_to_bridge"](change_at=1.0)
    net, bridge = count(scene, 0.5), count(scene, 1.5)
    assert net.pop("tetrahedra") == bridge.pop("tetrahedra") == 2760
    assert sum(net.values()) == 1584
    assert sum(bridge.values()) == 1320


def test_self_assembly() -> None:
    assert count(REGISTRY["self_assembly"](start=0.0)) == {"tetrahedra": 480, "points_to_point": 148}


@pytest.mark.parametrize("name", NAMES)
def test_nothing_to_warn_of(name: str) -> None:
    warnings = inspect_scene(REGISTRY[name]()).warnings
    if name == "monocycle":  # Appendix A prints an angle of 9, more than pi, at the right ankle
        assert len(warnings) == 1 and "right-foot" in warnings[0]
    else:
        assert warnings == []


@pytest.mark.parametrize("name", NAMES)
def test_documented_and_typed(name: str) -> None:
    make = REGISTRY[name]
    text = inspect.getdoc(make) or ""
    assert text.partition("\n")[0].endswith(".")
    for parameter in inspect.signature(make).parameters.values():
        assert parameter.annotation is not parameter.empty and parameter.default is not parameter.empty
    if name != "soft_mesh":  # the only one that is of no paper
        assert re.search(r"paper", text, re.IGNORECASE)


@pytest.mark.parametrize("name", NAMES)
def test_survives_its_file(name: str, tmp_path) -> None:
    small = {
        "curtain": {"m": 3, "rows": 2},
        "net_to_bridge": {"columns": 5, "lanes": 3},
        "self_assembly": {"divisions": 1},
        "letters": {"count": 5, "text": "AB C"},
        "dancer": {"layers": 2, "around": 24, "rows": 6},
    }
    scene = REGISTRY[name](**small.get(name, {}))
    scene.save(tmp_path / "scene.yaml")
    again = Scene.load(tmp_path / "scene.yaml")
    assert again.definition == scene.definition
    assert np.array_equal(again.build()[0].mass, scene.build()[0].mass)


@pytest.mark.parametrize("name", [name for name in NAMES if name not in TOO_LARGE])
def test_the_file_in_the_package_is_the_scene(name: str) -> None:
    stored, made = Scene.load(YAML / f"{name}.yaml").build(), REGISTRY[name]().build()
    assert np.allclose(stored[0].rest, made[0].rest, rtol=0.0, atol=1e-12)
    assert fingerprint_of(stored[0]) == fingerprint_of(made[0])
    assert count(Scene.load(YAML / f"{name}.yaml")) == count(REGISTRY[name]())


def fingerprint_of(model: Model) -> dict[str, object]:
    """What a checkpoint tells scenes apart by, but for what may differ by round-off."""
    return {name: value for name, value in fingerprint(model).items() if not is_digest(value)}


def is_digest(value: object) -> bool:
    return isinstance(value, str) and len(value) == 64


def test_files_are_those_of_the_scenes() -> None:
    assert {path.stem for path in YAML.glob("*.yaml")} == set(REGISTRY) - set(TOO_LARGE)
    assert max(path.stat().st_size for path in YAML.iterdir()) < 1_000_000


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("curtain", {"m": 1}),
        ("curtain", {"edge": -0.1}),
        ("robot_on_ropes", {"drop": 9.0}),
        ("robot_on_ropes", {"mesh": "missing.obj"}),
        ("net_to_bridge", {"columns": 2}),
        ("net_to_bridge", {"change_at": 0.0}),
        ("self_assembly", {"divisions": 0}),
        ("self_assembly", {"thickness": 0.6}),
        ("soft_mesh", {"mesh": "missing.obj"}),
        ("soft_mesh", {"scale": 0.0}),
    ],
)
def test_wrong_parameters_are_named(name: str, wrong: dict) -> None:
    with pytest.raises(InputError) as caught:
        REGISTRY[name](**wrong)
    key, value = next(iter(wrong.items()))
    assert key in str(caught.value) or str(value) in str(caught.value)
    assert "\n" not in str(caught.value)
