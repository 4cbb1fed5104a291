"""The graph of constrained objects (Figure 8): kinds of constraints, and a picture that can be read."""

import itertools
import re
import xml.etree.ElementTree as xml
from pathlib import Path

import numpy as np
import pytest

import turnbuckle.scenes
from turnbuckle.data.errors import InputError
from turnbuckle.scene.definitions import JOINTS
from turnbuckle.scene.graph.edges import ANGLE, BOTH, POINT, constraint_graph
from turnbuckle.scene.graph.layout import layout
from turnbuckle.scene.graph.svg import graph_svg
from turnbuckle.scene.language.reader import read_constraints_only
from turnbuckle.scene.scene import Scene
from turnbuckle.scenes import REGISTRY

APPENDIX = Path(turnbuckle.scenes.__file__).with_name("monocycle_constraints.gascuel")
SVG = "{http://www.w3.org/2000/svg}"


def boxes(text: str) -> dict[str, tuple[float, float, float, float]]:
    """x, y, width, height of each object's box by its label."""
    found = re.findall(
        r'<rect x="([-\d.]+)" y="([-\d.]+)" width="([\d.]+)" height="([\d.]+)"[^>]*/><text[^>]*>([^<]*)<', text
    )
    return {label: (float(x), float(y), float(w), float(h)) for x, y, w, h, label in found}


def test_kinds_of_all_joints() -> None:
    scene = Scene()
    for name in ("a", "b"):
        scene.add_rigid(name, sphere=1.0)
    axis = {"axis": [0, 0, 1]}
    own = {"universal": {"axis0": [1, 0, 0], "axis1": [0, 1, 0]}, "distance": {"max": 1.0}, "ball": {}, "weld": {}}
    own |= {"cone_twist": axis | {"cone": 1.0}, "rolling": {"normal": [0, 0, 1], "radius": 1.0}}
    for name in JOINTS.keys() - {"joint"}:
        scene.add_joint(
            name, name, body0="a", body1="b", local_pos0=[0, 0, 1], local_pos1=[0, 0, 0], **own.get(name, axis)
        )
    angle = {"axis0": [1, 0, 0], "axis1": [1, 0, 0], "max": 1.0}
    general = {
        "hinge": (POINT, {"anchor": [0, 0, 0]}),
        "rod": (POINT, {"axial": axis}),
        "cone": (ANGLE, {"angle": angle}),
        "stiff": (ANGLE, {"fixed_rotation": True}),
        "rod and cone": (BOTH, {"axial": axis, "angle": angle}),
        "knee": (BOTH, {"anchor": [0, 0, 0], "angle": angle}),
    }
    for name, (_, fields) in general.items():
        scene.add_joint("joint", name.replace(" ", "-"), body1="b", **fields)
    kinds = {edge.name: edge.kind for edge in constraint_graph(scene.definition).edges}
    for name in JOINTS.keys() - {"joint"}:
        assert kinds[name] == (POINT if name in ("ball", "distance", "point_to_ring") else BOTH), name
    for name, (kind, _) in general.items():
        assert kinds[name.replace(" ", "-")] == kind


def test_point_constraints_coatings_and_free_objects() -> None:
    scene = Scene()
    scene.add_rope("rope", start=[0, 0, 0], end=[1, 0, 0], segments=2)
    scene.add_rope("other", start=[1, 0, 0], end=[2, 0, 0], segments=2)
    scene.add_rigid("bone", sphere=1.0)
    scene.add_coating("flesh", around="bone", thickness=0.1)
    scene.add_rigid("ball", sphere=1.0)
    scene.add_constraint("nail", "n", points={"body": "rope", "index": 0})
    scene.add_constraint("points_to_point", "k", groups=[[{"body": "rope", "index": 2}, {"body": "other", "index": 0}]])
    scene.add_constraint("points_to_point", "s", join=[{"body": b, "index": 1} for b in ("rope", "flesh", "other")])
    graph = constraint_graph(scene.definition)
    assert graph.nodes == [None, "rope", "other", "bone"] and graph.free == ["ball"]
    ends = [(None, "rope"), ("rope", "other"), ("rope", "bone"), ("bone", "other")]
    assert [edge.ends for edge in graph.edges] == ends and graph.count(POINT) == 4


def test_layout_is_the_same_each_time_and_keeps_distances() -> None:
    ring = [(k, (k + 1) % 8) for k in range(8)]
    x = layout(8, ring)
    assert np.array_equal(x, layout(8, ring))
    sides = [np.linalg.norm(x[a] - x[b]) for a, b in ring]
    assert np.ptp(sides) < 1e-3 * np.mean(sides)  # a regular polygon
    chain = [(k, k + 1) for k in range(9)]
    x = layout(10, chain)
    assert np.allclose(np.linalg.norm(np.diff(x, axis=0), axis=1), 1.0, atol=1e-3)  # a straight line
    assert np.ptp(x[:, 1]) < 0.1  # that lies flat
    x = layout(4, [(0, 1), (0, 2), (0, 3)], ground=1)
    assert np.argmax(x[:, 1]) == 1  # y is down: the ground is lowest
    apart = layout(5, [(0, 1), (2, 3)])  # three parts side by side
    assert apart[2:4, 0].min() > apart[:2, 0].max() and apart[4, 0] > apart[2:4, 0].max()
    assert layout(0, []).shape == (0, 2)


@pytest.mark.parametrize("name", ["appendix", "snake", "otary", "puppet", "bricard", "closed_chain", "robot_on_ropes"])
def test_no_box_lies_on_another_and_all_are_on_the_page(name: str) -> None:
    definition = read_constraints_only(APPENDIX).definition if name == "appendix" else REGISTRY[name]().definition
    graph = constraint_graph(definition)
    text = graph_svg(graph, name)
    root = xml.fromstring(text)
    found = boxes(text)
    assert len(found) == len(graph.nodes)
    for (a, p), (b, q) in itertools.combinations(found.items(), 2):
        apart_x = abs(p[0] + p[2] / 2 - q[0] - q[2] / 2) - (p[2] + q[2]) / 2
        apart_y = abs(p[1] + p[3] / 2 - q[1] - q[3] / 2) - (p[3] + q[3]) / 2
        assert max(apart_x, apart_y) > 8.0, f"{a} lies on {b}"
    shift = [float(v) for v in root.find(f"{SVG}g").get("transform")[10:-1].split()]
    width, height = float(root.get("width")), float(root.get("height"))
    for x, y, w, h in found.values():
        assert (
            x + shift[0] > 10 and x + w + shift[0] < width - 10 and y + shift[1] > 10 and y + h + shift[1] < height - 40
        )
    titles = [title.text for title in root.iter(f"{SVG}title")]
    assert titles.count(graph.edges[0].name) >= 1 and len(titles) == len(graph.edges)


def test_the_legend_counts_as_figure_8() -> None:
    text = graph_svg(constraint_graph(read_constraints_only(APPENDIX).definition))
    for words in ("point only (2)", "point + angle (7)", "angle only (3)"):
        assert words in text


def test_two_constraints_of_one_pair_are_two_lines() -> None:
    scene = Scene()
    scene.add_rigid("a", sphere=1.0)
    for k in range(3):
        scene.add_joint("ball", f"j{k}", body1="a", anchor=[0, 0, k])
    paths = re.findall(r'<title>j\d</title><path d="([^"]+)"', graph_svg(constraint_graph(scene.definition)))
    assert len(set(paths)) == 3


def test_nothing_constrained_and_names_with_signs() -> None:
    scene = Scene()
    scene.add_rigid("lonely", sphere=1.0)
    root = xml.fromstring(graph_svg(constraint_graph(scene.definition), "a < b & c"))
    assert "not constrained: lonely" in "".join(root.itertext()) and "a < b & c" in "".join(root.itertext())


def test_a_graph_too_large_to_read_is_refused() -> None:
    scene = Scene()
    graph = constraint_graph(scene.definition)
    graph.nodes.extend(f"n{k}" for k in range(1600))
    with pytest.raises(InputError, match="the graph has 1600 objects; up to 1000 can be drawn"):
        graph_svg(graph)
