"""Impulses carried over from one list of contacts to the next."""

import numpy as np
from reference.contact_problem import frame

from turnbuckle.data.contact import Contacts
from turnbuckle.solvers.contact.warm_start import carry_over, match, to_world


def contacts(keys: list[tuple[int, int, int]], normals: np.ndarray) -> Contacts:
    """Contacts of features (kind, a, b) with the given normals."""
    kind, a, b = (np.array(column, dtype=np.int32).reshape(-1) for column in zip(*keys, strict=True))
    n = len(keys)
    return Contacts(kind, a, b, np.zeros((n, 4), np.int32), np.zeros((n, 4)), normals, np.zeros(n), np.zeros(n))


UP = np.array([0.0, 0.0, 1.0])


def test_friction_keeps_its_direction_in_the_world() -> None:
    """Frames turn about the normal between two rounds; the start is the same force."""
    keys = [(0, 3, 7), (0, 3, 8), (1, 3, 7)]
    before, now = contacts(keys, np.tile(UP, (3, 1))), contacts(keys[::-1], np.tile(UP, (3, 1)))
    impulse = np.array([[1.0, 0.2, 0.1], [2.0, 0.0, -0.5], [0.5, 0.3, 0.0]])
    old = np.array([frame(UP, turn) for turn in (0.1, 2.0, 4.0)])
    new = np.array([frame(UP, turn) for turn in (3.0, 1.0, 0.4)])
    world = to_world(old, impulse)
    start = carry_over(before, world, now, new, scale=0.5)
    assert np.abs(to_world(new, start) - 0.5 * world[::-1]).max() < 1e-15


def test_normal_part_is_a_number_and_friction_is_cut_to_the_cone() -> None:
    tilted = np.array([0.6, 0.0, 0.8])
    before, now = contacts([(0, 1, 2)], UP[None]), contacts([(0, 1, 2)], tilted[None])
    start = carry_over(before, np.array([[0.4, 0.0, 2.0]]), now, frame(tilted)[None], friction=np.array([0.1]))
    assert start[0, 0] == 2.0
    assert np.hypot(*start[0, 1:]) <= 0.2 * (1.0 + 1e-15)


def test_new_contacts_start_at_zero_and_the_nearest_normals_belong_together() -> None:
    side = np.array([0.0, 1.0, 0.0])
    lean = np.array([0.0, 0.6, 0.8])
    before = contacts([(0, 1, 2), (0, 1, 2), (1, 5, 9)], np.array([UP, side, UP]))
    now = contacts([(0, 1, 2), (0, 4, 4), (0, 1, 2), (0, 1, 2), (1, 5, 9)], np.array([side, UP, lean, UP, -UP]))
    old, new = match(before, now)
    assert dict(zip(new, old, strict=True)) == {0: 1, 3: 0}
    impulse = np.array([3.0 * UP, 2.0 * side, UP])
    start = carry_over(before, impulse, now, np.array([frame(n) for n in now.normal]))
    assert start[:, 0].tolist() == [2.0, 0.0, 0.0, 3.0, 0.0]


def test_empty_lists() -> None:
    none = Contacts(*(np.zeros(0, np.int32),) * 3, np.zeros((0, 4), np.int32), np.zeros((0, 4)), np.zeros((0, 3)),
                    np.zeros(0), np.zeros(0))  # fmt: skip
    some = contacts([(0, 1, 2)], UP[None])
    assert not carry_over(none, np.zeros((0, 3)), some, frame(UP)[None]).any()
    assert carry_over(some, UP[None], none, np.zeros((0, 3, 3))).shape == (0, 3)
