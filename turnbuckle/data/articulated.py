"""Rigid bodies, joints and the points tied to them, as the kernels see them: structs of arrays on the device."""

import warp as wp

from turnbuckle.data.rigid import ROWS

# What a row of a part asks (column `mode` of `RowTable`); s is its coordinate.
NONE = wp.constant(0)
EQUAL = wp.constant(1)  # s = 0
AT = wp.constant(2)  # s = lo
LIMIT = wp.constant(3)  # lo <= s <= hi
SOFT = wp.constant(4)  # a spring and damper outside of [lo, hi]
MOTOR = wp.constant(5)  # the rate of s is given, with a bounded multiplier

EACH = wp.constant(ROWS)


@wp.struct
class Bodies:
    """Rigid bodies; row 0 is the world. Those that are not dynamic have inverse mass and inertia 0."""

    dynamic: wp.array(dtype=wp.int32)
    mass: wp.array(dtype=wp.float64)
    inverse_mass: wp.array(dtype=wp.float64)
    inertia: wp.array(dtype=wp.vec3d)  # principal
    inverse_inertia: wp.array(dtype=wp.vec3d)
    damping: wp.array(dtype=wp.vec2d)  # linear, angular [1/s]
    force: wp.array(dtype=wp.vec3d)  # loads without gravity, at the time of the kick [N]
    torque: wp.array(dtype=wp.vec3d)  # about the centre of mass, world axes [N m]
    x0: wp.array(dtype=wp.vec3d)  # at the start of the step
    q0: wp.array(dtype=wp.quatd)
    v0: wp.array(dtype=wp.vec3d)
    w0: wp.array(dtype=wp.vec3d)
    x1: wp.array(dtype=wp.vec3d)  # at its end
    q1: wp.array(dtype=wp.quatd)
    v1: wp.array(dtype=wp.vec3d)
    w1: wp.array(dtype=wp.vec3d)
    v_free: wp.array(dtype=wp.vec3d)  # velocity without the impulses of constraints
    l_free: wp.array(dtype=wp.vec3d)  # angular momentum about the centre of mass, without them
    momentum: wp.array(dtype=wp.vec3d)  # angular momentum about the centre of mass, with them
    push: wp.array(dtype=wp.vec3d)  # impulse of constraints [N s]
    turn: wp.array(dtype=wp.vec3d)  # angular impulse of constraints about the centre of mass [N m s]


@wp.struct
class TiedPoints:
    """Mass points that a part of the system takes; the other ends of ties are points of rigid bodies."""

    point: wp.array(dtype=wp.int32)  # (n,) number among the points of the state
    mass: wp.array(dtype=wp.float64)  # (n,)
    x_free: wp.array(dtype=wp.vec3d)  # (n,) at the end of the step without the impulses of constraints
    push: wp.array(dtype=wp.vec3d)  # (n,) impulse of each half of the step [N s]
    blow: wp.array(dtype=wp.vec3d)  # (n,) impulse at its start alone, near singular poses [N s]
    x: wp.array(dtype=wp.vec3d)  # (points of the state,) at the end of the step
    v: wp.array(dtype=wp.vec3d)
    memory: wp.array(dtype=wp.vec3d)  # the velocity that the scheme remembers, where it does
    lags: int  # 1: v lags by a step, memory is Verlet's w


@wp.struct
class Parts:
    """Parts of joints (see `turnbuckle.data.rigid.JointParts`), then ties: weighted points with a goal."""

    kind: wp.array(dtype=wp.int32)
    on: wp.array(dtype=wp.int32)
    rows: wp.array(dtype=wp.int32)  # rows in use
    a: wp.array(dtype=wp.int32)
    b: wp.array(dtype=wp.int32)
    p_a: wp.array(dtype=wp.vec3d)
    p_b: wp.array(dtype=wp.vec3d)
    q_a: wp.array(dtype=wp.quatd)
    q_b: wp.array(dtype=wp.quatd)
    lo: wp.array(dtype=wp.float64)
    hi: wp.array(dtype=wp.float64)
    stiffness: wp.array(dtype=wp.float64)
    damping: wp.array(dtype=wp.float64)
    restitution: wp.array(dtype=wp.float64)
    target: wp.array(dtype=wp.float64)
    time_constant: wp.array(dtype=wp.float64)
    max_force: wp.array(dtype=wp.float64)
    partner: wp.array(dtype=wp.int32)  # motors: the row that limits what they drive, -1 without
    normal: wp.array(dtype=wp.vec3d)  # (3 n,) held directions of curves, surfaces and user domains, in b's frame
    normal0: wp.array(dtype=wp.vec3d)  # (3 n,) at the start of the step: where forces point
    node: wp.array(dtype=wp.int32)  # in the order of elimination
    place_a: wp.array(dtype=wp.int32)  # of the block of a in the matrix, -1 without
    place_b: wp.array(dtype=wp.int32)
    above_a: wp.array(dtype=wp.int32)  # 1: stored as (a, part), not as (part, a)
    above_b: wp.array(dtype=wp.int32)
    tie: wp.array(dtype=wp.int32)  # (n + 1,) into the columns below
    tie_body: wp.array(dtype=wp.int32)  # body, or -1: a mass point
    tie_point: wp.array(dtype=wp.int32)  # number in TiedPoints
    tie_local: wp.array(dtype=wp.vec3d)  # place in the body's inertial frame
    tie_weight: wp.array(dtype=wp.float64)
    tie_place: wp.array(dtype=wp.int32)
    tie_above: wp.array(dtype=wp.int32)
    goal: wp.array(dtype=wp.vec3d)  # of ties, at the end of the step [m]
    goal_rate: wp.array(dtype=wp.vec3d)  # [m/s]


@wp.struct
class RowTable:
    """Rows of all parts, `EACH` a part. A force f of a row acts as ``f line`` on a and ``-f line`` on b at one point."""

    mode: wp.array(dtype=wp.int32)
    active: wp.array(dtype=wp.int32)  # limits, soft: +1 at lo, -1 at hi, 0 off; motors: the sign at which they saturate
    changes: wp.array(dtype=wp.int32)  # of `active` in this step
    s: wp.array(dtype=wp.float64)  # coordinate at the iterate [m or rad]
    s0: wp.array(dtype=wp.float64)  # at the start of the step
    rate0: wp.array(dtype=wp.float64)
    line: wp.array(dtype=wp.vec3d)  # direction of the force
    t_a: wp.array(dtype=wp.vec3d)  # torque of a unit force about the centre of a
    t_b: wp.array(dtype=wp.vec3d)
    impulse: wp.array(dtype=wp.float64)  # of each half of the step, in the directions of its middle [N s or N m s]
    impulse1: wp.array(dtype=wp.float64)  # of the projection of velocities, in the directions at its end
    at: wp.array(dtype=wp.vec3d)  # the common point
    line0: wp.array(dtype=wp.vec3d)  # at the start of the step
    at0: wp.array(dtype=wp.vec3d)
    t0: wp.array(dtype=wp.vec3d)  # of torque rows
    line_mid: wp.array(dtype=wp.vec3d)  # in its middle: where the impulses of the position stage act
    t_mid: wp.array(dtype=wp.vec3d)  # their torque on a
    dropped: wp.array(dtype=wp.int32)  # 1: repeats other rows, or may do (joints have begun to act)


@wp.struct
class Islands:
    """Bodies, tied points and parts that hang together; each is solved by one thread."""

    node: wp.array(dtype=wp.int32)  # (n + 1,) nodes as eliminated
    body_start: wp.array(dtype=wp.int32)
    body: wp.array(dtype=wp.int32)
    body_node: wp.array(dtype=wp.int32)  # by position in `body`
    node_of: wp.array(dtype=wp.int32)  # by body
    point_start: wp.array(dtype=wp.int32)
    point: wp.array(dtype=wp.int32)  # numbers in TiedPoints
    point_node: wp.array(dtype=wp.int32)
    part_start: wp.array(dtype=wp.int32)
    part: wp.array(dtype=wp.int32)
    iterations: wp.array(dtype=wp.int32)  # of the last step
    worst: wp.array(dtype=wp.float64)  # row residual left [m or rad]
    angle: wp.array(dtype=wp.float64)  # largest rotation of a body in the step [rad]
    warm: wp.array(dtype=wp.float64)  # (1,) factor on the last impulses to start from; 0: from zero
    paper: int  # 1: motion by (1)-(4)
