"""How many rows each part of a joint has, and what they ask."""

import numpy as np

from turnbuckle.data import rigid
from turnbuckle.data.articulated import AT, EQUAL, LIMIT, MOTOR, NONE, SOFT
from turnbuckle.data.rigid import FREE, ROWS, JointParts

FIRST = {  # rows of equality before the coordinate that lo and hi bound
    rigid.POINT: 3, rigid.SEGMENT: 2, rigid.RING: 1, rigid.FIXED: 3, rigid.ROLLING: 3,
}  # fmt: skip
BOUNDED = (rigid.SEGMENT, rigid.RING, rigid.SPHERE, rigid.ANGLE, rigid.TWIST)


def row_modes(parts: JointParts) -> tuple[np.ndarray, np.ndarray]:
    """Rows of each part (k,), and their modes (k, ROWS)."""
    modes = np.full((parts.count, ROWS), int(NONE), dtype=np.int32)
    rows = np.zeros(parts.count, dtype=np.int32)
    for kind, count in FIRST.items():
        which = parts.kind == kind
        modes[which, :count] = int(EQUAL)
        rows[which] = count
    bounded = np.isin(parts.kind, BOUNDED) & ((parts.lo > -FREE) | (parts.hi < FREE))
    mode = np.where(parts.lo == parts.hi, int(AT), int(LIMIT))
    mode = np.where(parts.soft, int(SOFT), mode)
    which = np.flatnonzero(bounded)
    modes[which, rows[which]] = mode[which]
    rows[which] += 1
    straight = (parts.kind == rigid.ANGLE) & (parts.lo == 0.0) & (parts.hi == 0.0) & ~parts.soft
    modes[straight, :2] = int(EQUAL)
    rows[straight] = 2
    motors = np.isin(parts.kind, (rigid.MOTOR_AXIAL, rigid.MOTOR_TWIST))
    modes[motors, 0] = int(MOTOR)
    rows[motors] = 1
    looked_up = np.isin(parts.kind, (rigid.CURVE, rigid.SURFACE, rigid.CALLABLE))
    rows[looked_up] = 3  # their modes are set with every look
    return rows, modes


def limits_of_motors(parts: JointParts, modes: np.ndarray) -> np.ndarray:
    """The limit row (part * ROWS + row) of what each motor drives (k,), -1 where there is none and for all other parts."""
    out = np.full(parts.count, -1, dtype=np.int64)
    for motor, driven in ((rigid.MOTOR_AXIAL, rigid.SEGMENT), (rigid.MOTOR_TWIST, rigid.TWIST)):
        for m in np.flatnonzero(parts.kind == motor):
            for part in np.flatnonzero((parts.kind == driven) & (parts.joint == parts.joint[m])):
                row = np.flatnonzero(modes[part] == int(LIMIT))
                if len(row):
                    out[m] = ROWS * part + row[0]
    return out
