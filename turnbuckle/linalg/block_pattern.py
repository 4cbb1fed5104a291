"""Where the 3 x 3 blocks of elements go in a symmetric block-sparse matrix, found once.

Every internal force is blind to translations, so the blocks of a row of ``-K`` or ``-D`` sum to zero: elements give their
blocks (i, j) with i != j only, and the diagonal is what is left, ``A_ii = M_i - sum_{j != i} A_ij``. Contributions to a
block are listed in the order of elements and summed by one thread, so the sum does not depend on the number of threads.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class BlockPattern:
    """Block-compressed rows with sorted columns, and who adds what.

    Pairs are the upper blocks (i < j), sorted. A pair is the sum of stored blocks (`block_slots`, ``~slot`` for a
    transposed one) and of outer products of stored vectors (`outer_slots`). Rows of blocks that are *cut* are identity;
    blocks between them and others are kept behind the matrix, from `nnz` on, since the diagonal of the others needs them.
    """

    n: int  # rows of blocks
    indptr: np.ndarray  # (n + 1,) int32
    indices: np.ndarray  # (nnz,) int32
    diagonal: np.ndarray  # (n,) int32, where A_ii lies
    upper: np.ndarray  # (pairs,) int32, where A_ij lies
    lower: np.ndarray  # (pairs,) int32, where A_ji lies
    block_offsets: np.ndarray  # (pairs + 1,) int32 into block_slots
    block_slots: np.ndarray  # int32
    outer_offsets: np.ndarray  # (pairs + 1,) int32 into outer_slots
    outer_slots: np.ndarray  # (k, 2) int32
    row_offsets: np.ndarray  # (n + 1,) int32 into row_places
    row_places: np.ndarray  # int32, where the blocks beside the diagonal of each row lie
    stored: int  # blocks in all: nnz, and those behind

    @property
    def nnz(self) -> int:
        """Blocks of the matrix."""
        return len(self.indices)


def make_pattern(
    n: int, blocks: np.ndarray, outer: np.ndarray, outer_slots: np.ndarray, cut: np.ndarray
) -> BlockPattern:
    """The pattern for n rows.

    Args:
        blocks: (b, 2) rows and columns of the stored blocks, in the order of their slots.
        outer: (k, 2) rows and columns of outer products.
        outer_slots: (k, 2) slots of their two vectors.
        cut: (n,) bool, rows that are identity.
    """
    pairs = np.concatenate([blocks, outer]).astype(np.int64).reshape(-1, 2)
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    key, member = np.unique(low * n + high, return_inverse=True)
    member = member.ravel()
    i, j = key // n, key % n
    count, m = len(key), len(blocks)
    turned = pairs[:, 0] > pairs[:, 1]
    slot = np.arange(m)
    block_offsets, order = grouped(member[:m], count)
    block_slots = np.where(turned[:m], ~slot, slot)[order]
    outer_offsets, order = grouped(member[m:], count)
    vectors = np.where(turned[m:, None], outer_slots[:, ::-1], outer_slots).reshape(-1, 2)[order]
    inside = ~cut[i] & ~cut[j]
    a, b = i[inside], j[inside]
    rows, columns = np.r_[np.arange(n), a, b], np.r_[np.arange(n), b, a]
    by_place = np.argsort(rows * n + columns)
    place = np.empty(len(rows), dtype=np.int64)
    place[by_place] = np.arange(len(rows))
    outside = np.flatnonzero(~inside)
    upper, lower = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    upper[inside], lower[inside] = place[n : n + len(a)], place[n + len(a) :]
    upper[outside] = len(rows) + 2 * np.arange(len(outside))
    lower[outside] = upper[outside] + 1
    row_offsets, order = grouped(np.r_[i, j], n)
    return BlockPattern(
        n=n,
        indptr=np.r_[0, np.cumsum(np.bincount(rows, minlength=n))].astype(np.int32),
        indices=columns[by_place].astype(np.int32),
        diagonal=place[:n].astype(np.int32),
        upper=upper.astype(np.int32),
        lower=lower.astype(np.int32),
        block_offsets=block_offsets,
        block_slots=block_slots.astype(np.int32),
        outer_offsets=outer_offsets,
        outer_slots=np.ascontiguousarray(vectors, dtype=np.int32),
        row_offsets=row_offsets,
        row_places=np.r_[upper, lower][order].astype(np.int32),
        stored=len(rows) + 2 * len(outside),
    )


def grouped(owner: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Offsets (n + 1,) int32 and the items of each owner in a row, in the order in which they come."""
    order = np.argsort(owner, kind="stable")
    return np.r_[0, np.cumsum(np.bincount(owner, minlength=n))].astype(np.int32), order
