"""The block factor of joints against a dense solve, on random graphs, in both orders, with rows that repeat others."""

import numpy as np
import pytest
import warp as wp
from reference.block_system import DenseSystem

from turnbuckle.linalg import elimination
from turnbuckle.linalg.block_ldl import RANK, BlockMatrix, backward_node, factor_node, forward_node, make_plan, upload
from turnbuckle.linalg.elimination import Elimination, eliminate


@wp.kernel
def factor_all(m: BlockMatrix, n: int, rank: wp.float64, dropped: wp.array(dtype=wp.int32)):
    for k in range(n):
        dropped[0] = dropped[0] + factor_node(m, k, rank)
    for k in range(n):
        forward_node(m, k)
    for k in range(n):
        backward_node(m, n - 1 - k)


ORDERS = {"bodies first": {"CROWD": 10**9}, "tree": {"CROWD": -1, "TREE_GAIN": 0.0}, "as it is": {}}


def solve(system: DenseSystem, push: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, int, Elimination]:
    """dv by the block factor, how many rows it dropped, and the order it took."""
    bodies = len(system.body_size)
    plan = make_plan(eliminate(bodies, system.parts), np.r_[system.body_size, system.rows])
    m, number = upload(plan, "cpu"), plan.elimination.number
    value, scale, x = m.value.numpy(), m.scale.numpy(), m.x.numpy()
    for b, size in enumerate(system.body_size):
        own = slice(system.at[b], system.at[b + 1])
        first = plan.diagonal[number[b]]
        value[first : first + size * size] = system.M[own, own].ravel()
        x[plan.scalar[number[b]] : plan.scalar[number[b]] + size] = push[own]
    scales = system.scale()
    for p, on in enumerate(system.parts):
        rows, node = slice(system.row_at[p], system.row_at[p + 1]), number[bodies + p]
        for b in on:
            jacobian = system.J[rows, system.at[b] : system.at[b + 1]]
            place, above = plan.place(int(node), int(number[b]))
            value[place : place + jacobian.size] = (jacobian.T if above else jacobian).ravel()
        x[plan.scalar[node] : plan.scalar[node] + system.rows[p]] = rate[rows]
        scale[plan.scalar[node] : plan.scalar[node] + system.rows[p]] = scales[rows]
    dropped = wp.zeros(1, dtype=wp.int32, device="cpu")
    wp.launch(factor_all, 1, inputs=[m, len(number), RANK, dropped], device="cpu")
    x = m.x.numpy()
    dv = [x[plan.scalar[number[b]] : plan.scalar[number[b]] + size] for b, size in enumerate(system.body_size)]
    return np.concatenate(dv), int(dropped.numpy()[0]), plan.elimination


def agree(system: DenseSystem, rng: np.random.Generator) -> None:
    push = rng.normal(size=system.at[-1])
    rate = system.J @ rng.normal(size=system.at[-1])  # rows that repeat others do not contradict them
    dv, dropped, order = solve(system, push, rate)
    assert dropped == system.row_at[-1] - system.rank
    size = np.abs(system.solve(push, rate)).max()
    assert np.abs(dv - system.solve(push, rate)).max() < 1e-7 * size
    assert np.abs(system.J @ dv - rate).max() < 1e-8 * max(size, 1.0)
    assert sorted(order.number) == list(range(len(order.number)))


def random_graph(rng: np.random.Generator, bodies: int, loops: int, alone: int) -> DenseSystem:
    """A tree of joints, with joints that close loops and parts on one body alone (nails, joints with the world)."""
    parts = [np.array(sorted((b, int(rng.integers(0, b))))) for b in range(1, bodies)]
    parts += [np.sort(rng.choice(bodies, 2, replace=False)) for _ in range(loops)]
    parts += [np.array([int(rng.integers(0, bodies))]) for _ in range(alone)]
    rows = np.r_[rng.integers(1, 4, bodies - 1), np.ones(loops, int), rng.integers(1, 3, alone)]
    return DenseSystem(rng, rng.choice([3, 6], bodies, p=[0.2, 0.8]), parts, rows)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("seed", range(12))
def test_random_graphs(monkeypatch: pytest.MonkeyPatch, order: str, seed: int) -> None:
    for name, value in ORDERS[order].items():
        monkeypatch.setattr(elimination, name, value)
    rng = np.random.default_rng(seed)
    agree(random_graph(rng, int(rng.integers(2, 14)), int(rng.integers(0, 4)), int(rng.integers(0, 3))), rng)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("seed", range(6))
def test_rows_that_repeat_others_are_counted(monkeypatch: pytest.MonkeyPatch, order: str, seed: int) -> None:
    for name, value in ORDERS[order].items():
        monkeypatch.setattr(elimination, name, value)
    rng = np.random.default_rng(100 + seed)
    bodies = int(rng.integers(3, 9))
    parts = [np.array([b - 1, b]) for b in range(1, bodies)]
    twice = [int(p) for p in rng.choice(len(parts), 2, replace=False)]
    rows = rng.integers(1, 4, len(parts))
    system = DenseSystem(rng, np.full(bodies, 6), [*parts, *(parts[p] for p in twice)], np.r_[rows, rows[twice]])
    for k, p in enumerate(twice):
        system.repeat(p, len(parts) + k)
    assert system.row_at[-1] - system.rank == rows[twice].sum()
    agree(system, rng)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("ties", [6, 7, 12])
def test_a_part_of_one_body_with_many_ties(monkeypatch: pytest.MonkeyPatch, order: str, ties: int) -> None:
    """A body held by the world, from which many hang: its own part sees what hangs on it first."""
    for name, value in ORDERS[order].items():
        monkeypatch.setattr(elimination, name, value)
    rng = np.random.default_rng(ties)
    parts = [np.array([0, b]) for b in range(1, ties + 1)] + [np.array([0]), np.array([0]), np.array([1])]
    agree(DenseSystem(rng, np.r_[6, np.full(ties, 3)], parts, np.r_[np.full(ties, 3), 3, 2, 1]), rng)


def test_crowds_take_the_order_of_the_tree_and_islands_stay_apart() -> None:
    star = [np.array([0, b]) for b in range(1, 31)]
    far = [np.array([31, 32])]
    found = eliminate(33, [*star, *far])
    assert len(found.island) == 3 and found.island[-1] == 33 + 31
    assert max(len(rows) for rows in found.rows) <= 2, "bodies first, 30 parts would be a clique"
    label = np.searchsorted(found.island, found.number, side="right")
    assert len({*label[:31], *label[33 : 33 + 30]}) == 1 and label[31] == label[32] == label[-1] != label[0]
