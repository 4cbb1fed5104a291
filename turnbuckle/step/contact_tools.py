"""Contact on arrays, for time steppers of one's own: the parts of a step, each usable alone.

surfaces = make_surfaces([SurfacePart(0, support, triangles=faces)], x)     what may touch
detector = ContactDetector(surfaces, moves)                                 what is near, what a way crosses
problem  = contact_problem(surfaces, contacts, s0, velocity, masses, h)     rows, for points with masses or any A
solution = solve_contact(problem, "newton")                                 velocities and impulses
refined  = refine_contacts(near, solve, crossed)                            until the way is clear
"""

import numpy as np
import scipy.sparse as sp

from turnbuckle.contact.detector import Detector
from turnbuckle.contact.manifold import refine
from turnbuckle.data.contact import FRICTION_SHAPES, ContactProblem, Contacts, ContactSolution, Surfaces
from turnbuckle.data.errors import InputError
from turnbuckle.solvers.contact.anticipation import solve_anticipation
from turnbuckle.solvers.contact.ica import solve_ica
from turnbuckle.solvers.contact.newton import NewtonSolver
from turnbuckle.step.contact_rows import PointMap, contact_rows, frames

ContactDetector = Detector
refine_contacts = refine
SOLVERS = ("newton", "ica", "anticipation")


def contact_problem(
    surfaces: Surfaces,
    contacts: Contacts,
    s0: np.ndarray,
    free: np.ndarray,
    a: np.ndarray | sp.bsr_array,
    h: float,
    distance: float | np.ndarray = 0.0,
    friction: float | np.ndarray | None = None,
    fixed: np.ndarray | None = None,
) -> ContactProblem:
    """The problem of mean velocities ``u`` (n, 3) [m/s] that move points by ``h u`` in a step of ``h`` [s].

    ``s0`` (s, 3) [m]: surface vertices at the start; ``free`` (n, 3) [m/s]: mean velocities without contact, so that
    points would move by ``h free``. ``a``: masses (n,) [kg] of an explicit scheme, or the matrix of an implicit one
    (3 n, 3 n) in 3 x 3 blocks. Each row asks for ``distance`` [m] (one, or one a contact), or for that at the start
    where it is less. ``friction``: coefficient, one or one a contact; that of `surfaces` (static) when left out.
    ``fixed`` (n,) bool: points that keep their free velocity. Raises `InputError`.
    """
    free = np.asarray(free, dtype=np.float64)
    if free.ndim != 2 or free.shape[1] != 3 or not (np.isfinite(free).all() and h > 0.0):
        raise InputError(
            f"free: expected finite velocities of shape (n, 3) and h > 0, got shape {free.shape} and h = {h}"
        )
    n = len(free)
    if not isinstance(a, sp.bsr_array):
        masses = np.asarray(a, dtype=np.float64)
        if masses.shape != (n,) or not (masses > 0.0).all():
            raise InputError(f"a: expected {n} masses above 0, or a scipy bsr_array of 3 x 3 blocks")
        index = np.arange(n + 1, dtype=np.int32)
        a = sp.bsr_array((masses[:, None, None] * np.eye(3), index[:-1], index), shape=(3 * n, 3 * n))
    if a.shape != (3 * n, 3 * n) or a.blocksize != (3, 3):
        raise InputError(f"a: expected shape {(3 * n, 3 * n)} in 3 x 3 blocks, got {a.shape} in {a.blocksize}")
    gap = np.einsum("mk,mkd,md->m", contacts.coefficients, np.asarray(s0)[contacts.vertices], contacts.normal)
    target = np.minimum(np.broadcast_to(distance, gap.shape), np.maximum(contacts.distance, 0.0))
    shape = surfaces.shape[contacts.vertices]
    mu = surfaces.friction[shape[:, 0], shape[:, 3], 0] if friction is None else np.broadcast_to(friction, gap.shape)
    rows = contact_rows(
        surfaces, contacts, frames(contacts.normal), np.zeros((n, 3)), PointMap(n, np.full(n, -1), n)
    )  # fmt: skip
    return ContactProblem(
        a=a, free=free.ravel(), j=rows, floor=(target - gap) / h, friction=np.array(mu, dtype=np.float64), fixed=fixed
    )


def solve_contact(
    problem: ContactProblem,
    solver: str = "newton",
    start: np.ndarray | None = None,
    tolerance: float = 1e-8,
    max_iterations: int = 200,
    friction_shape: str = "cone",
    device: str = "cpu",
) -> ContactSolution:
    """Velocities and impulses of a problem with any of the solvers: "newton", "ica" (Contact, 5.5), "anticipation" (5.1).

    ``start`` (m, 3) [N s]: impulses to start from, in the frames of the rows. ``tolerance`` [m/s]. A ``load`` of the problem
    is taken by "newton"; the others want `free` to be the free motion. Raises `InputError` for names that do not exist.
    """
    if solver not in SOLVERS:
        raise InputError(f"solver {solver!r} does not exist; there are {', '.join(SOLVERS)}")
    if friction_shape not in FRICTION_SHAPES:
        raise InputError(f"friction_shape {friction_shape!r} does not exist; there are {', '.join(FRICTION_SHAPES)}")
    if solver == "newton":
        if friction_shape != "cone":
            raise InputError(f"solver 'newton' knows the cone alone; take 'ica' or 'anticipation' for {friction_shape}")
        return NewtonSolver(device).solve(problem, start, None, tolerance, max_iterations)
    solve = solve_ica if solver == "ica" else solve_anticipation
    return solve(problem, start, tolerance, max_iterations, friction_shape)
