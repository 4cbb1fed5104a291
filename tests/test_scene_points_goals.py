"""Which points a selection means, and where goals are at a time."""

import numpy as np
import pytest

from turnbuckle.data.errors import InputError, StepError
from turnbuckle.scene.definitions import KeyframesDef, PointsDef
from turnbuckle.scene.goals import nail_goal, velocity_goal
from turnbuckle.scene.points import select, where_mask

GRID = np.stack(np.meshgrid(*[np.arange(4.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


def chosen(**fields: object) -> np.ndarray:
    return select(PointsDef(body="grid", **fields), GRID, "constraint 'test'")


def test_each_way_of_choosing() -> None:
    assert chosen(indices=[5, 2, 9]).tolist() == [5, 2, 9]
    assert chosen(index=63).tolist() == [63]
    assert chosen(nearest=[1.2, 2.4, -9]).tolist() == [1 * 16 + 2 * 4 + 0]
    assert chosen(nearest=[[3, 3, 3.1], [0.4, 0, 0]]).tolist() == [63, 0]
    assert chosen(all=True).tolist() == list(range(64))
    for fields, mask in [
        ({"box": [[1, 1, 1], [2, 2, 2]]}, ((GRID >= 1) & (GRID <= 2)).all(axis=1)),
        ({"where": "x + y > 4 and z == 0"}, (GRID[:, 0] + GRID[:, 1] > 4) & (GRID[:, 2] == 0)),
        ({"side": "+y"}, GRID[:, 1] == 3),
        ({"side": "-z"}, GRID[:, 2] == 0),
        ({"side": "+x", "thickness": 0.4}, GRID[:, 0] >= 2),
    ]:
        got = chosen(**fields)
        assert got.dtype == np.int32 and 0 < len(got) < 64
        np.testing.assert_array_equal(got, np.flatnonzero(mask))


def test_a_rotated_box_keeps_its_side() -> None:
    """Rounding in the rotation must not drop points from a side."""
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    back = GRID @ turn.T @ turn
    assert (back != GRID).any()
    assert len(select(PointsDef(body="g", side="-x", thickness=1e-12), back, "constraint")) == 16
    assert len(select(PointsDef(body="g", box=[[0, 0, 0], [0, 3, 3]]), back, "constraint")) == 16


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"index": 64}, "no point 64, the body has 64 points"),
        ({"indices": [0, 99]}, "no point 99"),
        ({"indices": [3, 1, 3]}, "point 3 is selected twice"),
        ({"nearest": [[0, 0, 0], [0.1, 0, 0]]}, "point 0 is selected twice"),
        ({"box": [[5, 5, 5], [6, 6, 6]]}, "box selects none of its 64 points.*x from 0 to 3"),
        ({"where": "z > 3"}, "where 'z > 3' selects none"),
        ({"where": "log(-1 - z)"}, "selects none"),
    ],
)
def test_wrong_selections_name_constraint_and_body(fields: dict, words: str) -> None:
    with pytest.raises(InputError, match="constraint 'test': points of 'grid': .*" + words):
        chosen(**fields)


def test_where_of_a_constant_holds_everywhere() -> None:
    assert where_mask("1", GRID).all() and not where_mask("0 > 1", GRID).any()


START = np.arange(6.0).reshape(2, 3)
TIMES = np.array([0.5, 1.0, 3.0])


def keyframes(**fields: object) -> KeyframesDef:
    return KeyframesDef(times=TIMES, **fields)


def test_fixed_goals() -> None:
    np.testing.assert_array_equal(nail_goal(None, START, "constraint 'n'").position(9.0), START)
    np.testing.assert_array_equal(nail_goal(np.ones(3), START, "constraint 'n'").position(0.0), np.ones((2, 3)))
    assert not nail_goal(None, START, "constraint 'n'").moves
    np.testing.assert_array_equal(velocity_goal(START, 2, "constraint 'n'").velocity(1.0), START)


@pytest.mark.parametrize("interpolation", ["linear", "smooth"])
def test_keyframes_hit_every_key_and_hold_outside(interpolation: str) -> None:
    values = np.random.default_rng(0).standard_normal((3, 2, 3))
    goal = nail_goal(keyframes(positions=values, interpolation=interpolation), START, "constraint 'n'")
    assert goal.moves
    for t, want in [(-1.0, 0), (0.5, 0), (1.0, 1), (3.0, 2), (9.0, 2)]:
        np.testing.assert_array_equal(goal.position(t), values[want])
    s = 0.25 if interpolation == "linear" else 0.25**2 * (3 - 0.5)
    np.testing.assert_allclose(goal.position(1.5), (1 - s) * values[1] + s * values[2], rtol=1e-13)
    assert np.abs(goal.position(1.0 - 1e-9) - values[1]).max() < 1e-8
    np.testing.assert_array_equal(goal.rate(9.0), 0.0)


def test_offsets_and_one_place_for_all() -> None:
    offsets = np.array([[0, 0, 0], [1.0, 0, 0], [0, 2, 0]])
    goal = nail_goal(keyframes(offsets=offsets), START, "constraint 'n'")
    np.testing.assert_allclose(goal.position(2.0), START + [0.5, 1, 0], rtol=1e-15)
    one = nail_goal(keyframes(positions=offsets), START, "constraint 'n'")
    np.testing.assert_array_equal(one.position(1.0), np.broadcast_to(offsets[1], (2, 3)))


@pytest.mark.parametrize("kind", ["linear", "smooth", "callable"])
def test_rates_and_accelerations_match_differences(kind: str) -> None:
    if kind == "callable":
        goal = nail_goal(lambda t: [np.sin(3 * t), t**2, np.exp(-t)], START, "constraint 'n'")
    else:
        values = np.random.default_rng(1).standard_normal((3, 2, 3))
        goal = nail_goal(keyframes(positions=values, interpolation=kind), START, "constraint 'n'")
    for t in (0.7, 1.6, 2.9):
        d = 1e-5
        rate = (goal.position(t + d) - goal.position(t - d)) / (2 * d)
        np.testing.assert_allclose(goal.rate(t), rate, atol=2e-8)
        acceleration = (goal.rate(t + d) - goal.rate(t - d)) / (2 * d)
        np.testing.assert_allclose(goal.acceleration(t), acceleration, atol=2e-5)
        assert np.abs(goal.rate(t)).max() > 1e-3


def test_the_rate_at_a_key_is_that_of_the_interval_before() -> None:
    goal = nail_goal(keyframes(positions=[[0, 0, 0], [1.0, 0, 0], [1.0, 4.0, 0]]), START, "constraint 'n'")
    np.testing.assert_allclose(goal.rate(1.0)[0], [2, 0, 0])
    np.testing.assert_allclose(goal.rate(1.0 + 1e-9)[0], [0, 2, 0])


def test_goals_of_the_wrong_shape_are_refused() -> None:
    for goal in (np.ones((3, 3)), keyframes(positions=np.ones((3, 4, 3)))):
        with pytest.raises(InputError, match="'n'.*(for 2 points give shape|2 points are selected)"):
            nail_goal(goal, START, "constraint 'n'")
    with pytest.raises(InputError, match=r"must return shape \(3,\) or \(2, 3\), got \(4,\)"):
        nail_goal(lambda t: np.ones(4), START, "constraint 'n'").position(0.0)
    with pytest.raises(InputError, match="failed at t = 0 s"):
        nail_goal(lambda t: "no", START, "constraint 'n'").position(0.0)
    with pytest.raises(StepError, match="not finite at t = 2 s"):
        nail_goal(lambda t: [np.nan, 0, 0], START, "constraint 'n'").position(2.0)


def test_a_callable_cannot_reach_what_it_returned() -> None:
    place = np.zeros(3)
    goal = nail_goal(lambda t: place, START, "constraint 'n'")
    first = goal.position(0.0)
    place[0] = 5.0
    assert first[0, 0] == 0.0 and goal.position(1.0)[1, 0] == 5.0
