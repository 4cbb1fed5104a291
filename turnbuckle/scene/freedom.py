"""Degrees of freedom of a mechanism: 6 a dynamic body, less the rank of what its joints hold, and which joints repeat others.

The rank is found body by body. Of the rows that touch a body, those combinations that its six coordinates tell apart are
independent of all other rows and leave with it; the rest no longer touch it. What is left in the end repeats other rows.
Bodies with few rows go first, so that chains and trees take a time that grows with their length, and loops hardly more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnbuckle.scene.joint_rows import JointRows

SAME = 1e-9  # of the largest: rows that differ by less are the same
NAMED = 1500  # rows of an island up to which the joints that repeat each other are picked out


@dataclass(frozen=True)
class Freedom:
    """What a mechanism can do at the start."""

    degrees: int  # of freedom
    rows: int  # that joints hold
    repeated: int  # of them, those that others hold already
    joints: list[int]  # numbers of the joints that repeat each other


def freedom(rows: JointRows, moves: np.ndarray, length: float) -> Freedom:
    """``moves``: which bodies are dynamic (n,) bool; ``length`` [m] that a radian counts as."""
    columns = _columns(rows, moves, length)
    bodies = sorted({b for row in columns for b in row})
    touching: dict[int, set[int]] = {b: set() for b in bodies}
    for r, row in enumerate(columns):
        for b in row:
            touching[b].add(r)
    origin = [{int(j)} for j in rows.joint]  # joints that a row has come from
    rank, left = 0, [r for r, row in enumerate(columns) if not row]
    waiting = set(bodies)
    while waiting:
        b = min(waiting, key=lambda i: (len(touching[i]), i)) if len(waiting) < 400 else _light(waiting, touching)
        waiting.remove(b)
        mine = sorted(touching[b])
        if not mine:
            continue
        near = sorted({other for r in mine for other in columns[r]} - {b})
        block = np.array([columns[r][b] for r in mine])
        u, s, _ = np.linalg.svd(block)
        k = int((s > SAME * max(1.0, s[0])).sum())
        rank += k
        rest = u[:, k:].T  # combinations that do not touch b
        come_from = set().union(*(origin[r] for r in mine))
        after = {other: rest @ np.array([columns[r].get(other, np.zeros(6)) for r in mine]) for other in near}
        for r in mine:
            for other in columns[r]:
                touching[other].discard(r)
            columns[r] = {}
        for i, r in enumerate(mine[: len(rest)]):
            columns[r] = {other: block[i] for other, block in after.items() if np.abs(block[i]).max() > SAME}
            origin[r] = come_from
            for other in columns[r]:
                touching[other].add(r)
            if not columns[r]:
                left.append(r)
    joints = _repeating(rows, moves, length, sorted(set().union(*(origin[r] for r in left)))) if left else []
    return Freedom(6 * int(moves.sum()) - rank, len(rows.joint), len(left), joints)


def _light(waiting: set[int], touching: dict[int, set[int]]) -> int:
    """A body with few rows, without looking at all."""
    best, few = -1, 1 << 30
    for i, b in enumerate(waiting):
        if len(touching[b]) < few:
            best, few = b, len(touching[b])
        if few <= 6 or i > 400:
            break
    return best


def _columns(rows: JointRows, moves: np.ndarray, length: float) -> list[dict[int, np.ndarray]]:
    """Of each row its coefficients by dynamic body, all of a size of about 1."""
    out: list[dict[int, np.ndarray]] = []
    scale = np.where(rows.turning, 1.0, 1.0 / length)[:, None]
    ends = []
    for body, sign, torque in ((rows.a, 1.0, rows.torque_a), (rows.b, -1.0, rows.torque_b)):
        ends.append((body, sign * np.concatenate([rows.force, torque * scale], axis=1)))
    for r in range(len(rows.joint)):
        out.append({int(body[r]): values[r] for body, values in ends if moves[body[r]]})
    return out


def _repeating(rows: JointRows, moves: np.ndarray, length: float, joints: list[int]) -> list[int]:
    """Of ``joints``, those whose rows take part in a combination that holds nothing."""
    which = np.flatnonzero(np.isin(rows.joint, joints))
    if len(which) > NAMED:
        return joints
    columns = _columns(rows, moves, length)
    bodies = sorted({b for r in which for b in columns[r]})
    matrix = np.zeros((len(which), 6 * len(bodies)))
    for i, r in enumerate(which):
        for b, values in columns[r].items():
            k = 6 * bodies.index(b)
            matrix[i, k : k + 6] = values
    u, s, _ = np.linalg.svd(matrix)
    rank = int((s > SAME * max(1.0, s.max(initial=0.0))).sum())
    part = np.square(u[:, rank:]).sum(axis=1)
    return [j for j in joints if part[rows.joint[which] == j].sum() > 1e-6]
