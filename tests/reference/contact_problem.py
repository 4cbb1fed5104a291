"""Random, realistic problems of frictional contact: cloth, soft solids, piles of rigid blocks, chains; and mixtures.

Every generator is a function of its arguments alone (the seed among them). Bodies move with gravity and with random
velocities, nodes are shaken a little so that nothing is symmetric, and floors are -gap / h as in Contact, (5).
"""

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from turnbuckle.data.contact import ContactProblem

GRAVITY = np.array([0.0, 0.0, -9.81])


def skew(r: np.ndarray) -> np.ndarray:
    """[r]x with [r]x w = r x w."""
    return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])


def frame(n: np.ndarray, turn: float = 0.0) -> np.ndarray:
    """Rows n, t1, t2, the tangents turned by an angle about n."""
    n = n / np.linalg.norm(n)
    t = np.cross(n, np.eye(3)[np.abs(n).argmin()])
    t /= np.linalg.norm(t)
    s = np.cross(n, t)
    return np.array([n, np.cos(turn) * t + np.sin(turn) * s, -np.sin(turn) * t + np.cos(turn) * s])


@dataclass
class World:
    """Bodies, contacts and equality rows that are being put together. Blocks of three unknowns are numbered as added."""

    h: float  # [s] length of the step
    rng: np.random.Generator
    position: list[np.ndarray] = field(default_factory=list)  # of each block; of a rigid body twice its centre
    velocity: list[np.ndarray] = field(default_factory=list)  # before the step
    force: list[np.ndarray] = field(default_factory=list)
    group: list[int] = field(default_factory=list)
    fixed: set[int] = field(default_factory=set)
    pairs: list[int] = field(default_factory=list)
    matrix: list[tuple[int, int, np.ndarray]] = field(default_factory=list)  # entries of A
    inertia: list[tuple[int, np.ndarray]] = field(default_factory=list)  # diagonal blocks of M
    contacts: list[tuple[dict[int, np.ndarray], np.ndarray, float, float]] = field(default_factory=list)
    joints: list[tuple[dict[int, np.ndarray], np.ndarray]] = field(default_factory=list)  # 3 rows each
    bodies: int = 0

    def add_points(self, x: np.ndarray, mass: np.ndarray, v: np.ndarray) -> np.ndarray:
        """A body of mass points. Returns its blocks."""
        first = len(self.position)
        for k in range(len(x)):
            self._block(x[k], v[k], mass[k] * GRAVITY, mass[k] * np.eye(3))
        self.bodies += 1
        return np.arange(first, first + len(x))

    def add_rigid(self, x: np.ndarray, mass: float, inertia: np.ndarray, v: np.ndarray, w: np.ndarray) -> int:
        """A rigid body. Returns its first block."""
        first = len(self.position)
        self.pairs.append(first)
        self._block(x, v, mass * GRAVITY, mass * np.eye(3))
        self._block(x, w, np.zeros(3), inertia)
        self.bodies += 1
        return first

    def _block(self, x: np.ndarray, v: np.ndarray, force: np.ndarray, mass: np.ndarray) -> None:
        i = len(self.position)
        self.position.append(x)
        self.velocity.append(v)
        self.force.append(force)
        self.group.append(self.bodies)
        self.inertia.append((i, mass))
        self.matrix.append((i, i, mass))

    def add_stiffness(self, blocks: np.ndarray, k: np.ndarray, damping: float = 0.0) -> None:
        """Stiffness (3 b, 3 b) of an element [N/m]; damping [s] as a part of it (Rayleigh)."""
        for a, i in enumerate(blocks):
            for b, j in enumerate(blocks):
                self.matrix.append((i, j, (self.h**2 + self.h * damping) * k[3 * a : 3 * a + 3, 3 * b : 3 * b + 3]))

    def add_spring(self, i: int, j: int, k: float) -> None:
        """Spring at its rest length, k / length [N/m] along it and a hundredth of that across."""
        d = self.position[i] - self.position[j]
        length = np.linalg.norm(d)
        d = d / length
        block = k / length * (0.99 * np.outer(d, d) + 0.01 * np.eye(3))
        self.add_stiffness(np.array([i, j]), np.block([[block, -block], [-block, block]]))

    def place(self, body: int | np.ndarray, at: np.ndarray | None = None) -> dict[int, np.ndarray]:
        """Velocity of a place: of a rigid body (first block and world position); or of weighted points {block: weight}."""
        if isinstance(body, dict):
            return {i: w * np.eye(3) for i, w in body.items()}
        return {body: np.eye(3), body + 1: -skew(at - self.position[body])}

    def touch(self, a: dict, b: dict, normal: np.ndarray, gap: float, mu: float) -> None:
        """Contact of place a with place b ({}: the ground), the normal from b to a."""
        rows = dict(a)
        for i, block in b.items():
            rows[i] = rows.get(i, 0.0) - block
        turned = frame(normal, self.rng.uniform(0.0, 2.0 * np.pi))
        self.contacts.append(({i: turned @ block for i, block in rows.items()}, turned, gap, mu))

    def join(self, a: dict, b: dict, rate: np.ndarray) -> None:
        """Ball joint of places a and b: three equality rows."""
        rows = dict(a)
        for i, block in b.items():
            rows[i] = rows.get(i, 0.0) - block
        self.joints.append((rows, np.asarray(rate)))

    def problem(self) -> ContactProblem:
        """The velocity problem of one step."""
        n, m = len(self.position), len(self.contacts)
        a = _blocks([(i, j, block) for i, j, block in self.matrix], n, n)
        mass = _blocks([(i, i, block) for i, block in self.inertia], n, n)
        # with all springs at rest: b = M v0 + h f (damping takes A - M of a velocity without deformation: nothing)
        right = mass @ np.concatenate(self.velocity) + self.h * np.concatenate(self.force)
        fixed = np.zeros(n, bool)
        fixed[list(self.fixed)] = True
        free = np.zeros(3 * n)
        moves = np.flatnonzero(np.repeat(~fixed, 3))
        free[np.repeat(fixed, 3)] = np.concatenate(self.velocity)[np.repeat(fixed, 3)]
        full = sp.csr_array(a)
        right -= full @ free
        free[moves] = sp.linalg.spsolve(sp.csc_array(full[moves][:, moves]), right[moves])
        j = _blocks([(c, i, block) for c, (rows, *_) in enumerate(self.contacts) for i, block in rows.items()], m, n)
        e, wanted = None, np.zeros(0)
        if self.joints:
            entries = [(c, i, block) for c, (rows, _) in enumerate(self.joints) for i, block in rows.items()]
            e = sp.csr_array(_blocks(entries, len(self.joints), n))
            wanted = np.concatenate([rate for _, rate in self.joints])
        return ContactProblem(
            a=a,
            free=free,
            j=j,
            floor=np.array([-gap / self.h for _, _, gap, _ in self.contacts]),
            friction=np.array([mu for *_, mu in self.contacts]),
            e=e,
            wanted=wanted,
            pairs=np.array(self.pairs, np.int32),
            groups=np.array(self.group, np.int32),
            fixed=fixed if fixed.any() else None,
        )


def _blocks(entries: list[tuple[int, int, np.ndarray]], rows: int, columns: int) -> sp.bsr_array:
    """Sum of 3 x 3 blocks, as BSR with sorted indices."""
    if not entries:
        return sp.bsr_array((3 * rows, 3 * columns), blocksize=(3, 3), dtype=float)
    i = np.array([e[0] for e in entries])
    k = np.array([e[1] for e in entries])
    data = np.array([e[2] for e in entries])
    key, which = np.unique(i * columns + k, return_inverse=True)
    total = np.zeros((len(key), 3, 3))
    np.add.at(total, which, data)
    start = np.searchsorted(key // columns, np.arange(rows + 1))
    return sp.bsr_array((total, key % columns, start), shape=(3 * rows, 3 * columns))


def add_cloth(world: World, n: int, origin: np.ndarray, spacing: float = 0.02, stiffness: float = 20.0) -> np.ndarray:
    """Square of n x n points: springs along, across and over two (bending), 0.2 kg/m^2, a wavy surface."""
    rng = world.rng
    u = np.arange(n) * spacing
    x = np.stack([*np.meshgrid(u, u, indexing="ij"), np.zeros((n, n))], axis=-1)
    x[..., 2] = 0.1 * spacing * np.sin(3.0 * x[..., 0] / spacing + 1.0) * np.cos(2.0 * x[..., 1] / spacing)
    x = x.reshape(-1, 3) + rng.normal(scale=0.03 * spacing, size=(n * n, 3)) + origin
    v = rng.normal(scale=0.05, size=(n * n, 3)) + [0.3, 0.1, -0.5]
    blocks = world.add_points(x, np.full(n * n, 0.2 * spacing**2), v)
    grid = blocks.reshape(n, n)
    for di, dj, share in ((1, 0, 1.0), (0, 1, 1.0), (1, 1, 0.5), (1, -1, 0.5), (2, 0, 0.1), (0, 2, 0.1)):
        for i in range(n - di):
            for j in range(max(0, -dj), n - max(0, dj)):
                world.add_spring(grid[i, j], grid[i + di, j + dj], share * stiffness)
    return grid


def cloth_on_plane(
    n: int = 10, layers: int = 1, mu: float = 0.3, seed: int = 0, h: float = 4e-3, stiffness: float = 20.0
) -> ContactProblem:
    """Layers of n x n points that fall on a bumpy ground and on each other, every vertex against a triangle."""
    world = World(h, np.random.default_rng(seed))
    rng, spacing, delta = world.rng, 0.02, 1e-3
    grids = [add_cloth(world, n, np.array([0.3, 0.2, layer]) * delta, spacing, stiffness) for layer in range(layers)]
    for i in grids[0].ravel():
        world.touch(world.place({i: 1.0}), {}, [*rng.normal(scale=0.1, size=2), 1.0], rng.uniform(0.0, delta), mu)
    for low, high in zip(grids[:-1], grids[1:], strict=True):
        for points, faces, sign in ((high, low, 1.0), (low, high, -1.0)):
            for i in range(n - 1):
                for j in range(n - 1):
                    face = (faces[i, j], faces[i + 1, j], faces[i + rng.integers(2), j + 1])
                    weights = rng.dirichlet([1.0, 1.0, 1.0])
                    below = world.place(dict(zip(map(int, face), weights, strict=True)))
                    normal = sign * np.array([*rng.normal(scale=0.1, size=2), 1.0])
                    world.touch(world.place({int(points[i, j]): 1.0}), below, normal, rng.uniform(0.0, delta), mu)
    return world.problem()


def tetrahedron_stiffness(x: np.ndarray, young: float, poisson: float) -> np.ndarray:
    """Linear elastic stiffness (12, 12) of a tetrahedron (4, 3)."""
    d = np.linalg.inv((x[1:] - x[0]).T).T
    grads = np.vstack([-d.T.sum(axis=0), d.T])
    strain = np.zeros((6, 12))
    for a, (gx, gy, gz) in enumerate(grads):
        strain[:, 3 * a : 3 * a + 3] = [[gx, 0, 0], [0, gy, 0], [0, 0, gz], [gy, gx, 0], [0, gz, gy], [gz, 0, gx]]
    lame, shear = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))
    law = np.diag([2 * shear] * 3 + [shear] * 3)
    law[:3, :3] += lame
    return abs(np.linalg.det(x[1:] - x[0])) / 6.0 * strain.T @ law @ strain


def add_cube(world: World, cells: int, size: float, low: np.ndarray, young: float, density: float = 1000.0):
    """Soft cube of cells^3 x 6 tetrahedra. Returns its blocks as a grid (cells + 1,) * 3."""
    rng, n, s = world.rng, cells + 1, size / cells
    x = np.stack(np.meshgrid(*[np.arange(n) * s] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    x = x + rng.normal(scale=0.02 * s, size=x.shape) + low
    index = np.arange(n**3).reshape(n, n, n)
    corner = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    paths = [(0, 4, 6, 7), (0, 4, 5, 7), (0, 2, 6, 7), (0, 2, 3, 7), (0, 1, 5, 7), (0, 1, 3, 7)]
    tets = [
        [index[tuple(np.array([i, j, k]) + corner[c])] for c in path]
        for i in range(cells)
        for j in range(cells)
        for k in range(cells)
        for path in paths
    ]
    mass = np.zeros(len(x))
    for t in tets:
        mass[t] += density * abs(np.linalg.det(x[t[1:]] - x[t[0]])) / 24.0
    v = rng.normal(scale=0.02, size=3) + [0.4, 0.2, -0.3] + rng.normal(scale=0.01, size=x.shape)
    blocks = world.add_points(x, mass, v)
    for t in tets:
        world.add_stiffness(blocks[t], tetrahedron_stiffness(x[t], young, 0.3), damping=0.0)
    return blocks.reshape(n, n, n)


def soft_stack(
    count: int = 2, cells: int = 2, young: float = 1e5, mu: float = 0.4, seed: int = 0, h: float = 0.01
) -> ContactProblem:
    """Soft cubes of 0.2 m on the ground and on each other; every bottom vertex touches a triangle of the cube below."""
    world = World(h, np.random.default_rng(seed))
    rng, size, delta = world.rng, 0.2, 2e-3
    grids = [add_cube(world, cells, size, np.array([0, 0, c * (size + delta)]), young) for c in range(count)]
    for c, grid in enumerate(grids):
        for i in range(cells + 1):
            for j in range(cells + 1):
                normal = np.array([*rng.normal(scale=0.02, size=2), 1.0])
                below = {}
                if c:
                    top = grids[c - 1][:, :, -1]
                    p, q = min(i, cells - 1), min(j, cells - 1)
                    face = (top[p, q], top[p + 1, q], top[p + rng.integers(2), q + 1])
                    below = world.place(dict(zip(map(int, face), rng.dirichlet([1.0] * 3), strict=True)))
                world.touch(world.place({int(grid[i, j, 0]): 1.0}), below, normal, rng.uniform(0.0, delta), mu)
    return world.problem()


def rigid_pile(
    count: int = 4, mu: float = 0.5, seed: int = 0, h: float = 0.01, ratio: float = 1.0, push: float = 0.5
) -> ContactProblem:
    """Tower of boxes, four corners each on the one below, the upper ones `ratio` times as heavy from floor to floor."""
    world = World(h, np.random.default_rng(seed))
    rng = world.rng
    half, low = np.array([0.2, 0.15, 0.1]), None
    for c in range(count):
        x = np.array([*rng.normal(scale=0.02, size=2), 0.1 + 0.201 * c])
        mass = 10.0 * ratio ** (c / max(count - 1, 1))
        inertia = mass / 3.0 * np.diag([half @ half - a * a for a in half])
        tilt = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        inertia = inertia + 0.02 * mass * half[2] ** 2 * tilt @ np.diag([1.0, 0.5, 0.2]) @ tilt.T
        v = rng.normal(scale=0.05, size=3) + [push, 0.5 * push, -0.2]
        body = world.add_rigid(x, mass, inertia, v, rng.normal(scale=0.2, size=3))
        for sx in (-1.0, 1.0):
            for sy in (-1.0, 1.0):
                at = x + [sx * half[0], sy * half[1], -half[2]] + rng.normal(scale=2e-3, size=3)
                below = {} if low is None else world.place(low, at)
                normal = [*rng.normal(scale=0.01, size=2), 1.0]
                world.touch(world.place(body, at), below, normal, rng.uniform(0.0, 1e-3), mu)
        low = body
    return world.problem()


def chain_on_plane(links: int = 8, mu: float = 0.4, seed: int = 0, h: float = 0.01, hung: bool = True):
    """Rods joined by balls (equality rows), one end held by the world, that fall on the ground with both ends each."""
    world = World(h, np.random.default_rng(seed))
    rng, half, before = world.rng, 0.1, None
    for c in range(links):
        x = np.array([0.2 * c, 0.0, 1e-3])
        direction = np.array([half, *rng.normal(scale=0.01, size=2)])
        inertia = half**2 / 3.0 * np.diag([0.05, 1.0, 1.0])
        body = world.add_rigid(x, 1.0, inertia, rng.normal(scale=0.3, size=3), rng.normal(scale=1.0, size=3))
        first, last = world.place(body, x - direction), world.place(body, x + direction)
        if before is not None or hung:
            world.join(first, before or {}, rng.normal(scale=1e-3, size=3))
        for place in (first, last):
            normal = [*rng.normal(scale=0.05, size=2), 1.0]
            world.touch(place, {}, normal, rng.uniform(0.0, 1e-3), mu)
        before = last
    return world.problem()


def mixed(mu: float = 0.4, seed: int = 0, h: float = 5e-3, stiffness: float = 20.0) -> ContactProblem:
    """A rigid box on cloth on a soft cube on the ground; a corner of the cloth nailed, a corner of the box jointed to it.

    Everything a problem may hold: all kinds of bodies, fixed blocks and equality rows.
    """
    world = World(h, np.random.default_rng(seed))
    rng, cells, n = world.rng, 2, 7
    cube = add_cube(world, cells, 0.12, np.zeros(3), 1e5)
    cloth = add_cloth(world, n, np.array([0.0, 0.0, 0.122]), stiffness=stiffness)
    x, half = np.array([0.06, 0.06, 0.174]), np.array([0.05, 0.05, 0.05])
    box = world.add_rigid(x, 1.0, half @ half / 3.0 * np.eye(3) * 2 / 3, np.array([0.4, 0.0, -0.5]), np.ones(3))
    for i in cube[:, :, 0].ravel():
        world.touch(world.place({int(i): 1.0}), {}, [0.0, 0.0, 1.0], rng.uniform(0.0, 1e-3), mu)
    for i in cloth.ravel():
        p = np.minimum((world.position[i][:2] / 0.06).astype(int), cells - 1).clip(0)
        face = (cube[p[0], p[1], -1], cube[p[0] + 1, p[1], -1], cube[p[0], p[1] + 1, -1])
        below = world.place(dict(zip(map(int, face), rng.dirichlet([1.0] * 3), strict=True)))
        world.touch(world.place({int(i): 1.0}), below, [*rng.normal(scale=0.05, size=2), 1.0], rng.uniform(0, 1e-3), mu)
    for sx in (-1.0, 1.0):
        for sy in (-1.0, 1.0):
            at = x + [sx * half[0], sy * half[1], -half[2]]
            p = np.minimum((at[:2] / 0.02).astype(int), n - 2).clip(0)
            face = (cloth[p[0], p[1]], cloth[p[0] + 1, p[1]], cloth[p[0], p[1] + 1])
            below = world.place(dict(zip(map(int, face), rng.dirichlet([1.0] * 3), strict=True)))
            world.touch(world.place(box, at), below, [*rng.normal(scale=0.05, size=2), 1.0], rng.uniform(0, 1e-3), mu)
    corner = int(cloth[-1, -1])
    world.join(world.place(box, world.position[corner]), world.place({corner: 1.0}), np.zeros(3))
    world.fixed.add(int(cloth[0, 0]))
    world.velocity[int(cloth[0, 0])] = np.array([0.0, 0.0, 0.1])
    return world.problem()
