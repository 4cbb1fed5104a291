"""Rubber letters fall in layers into a box, whose walls then push in: Contact, Figure 7."""

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.meshes.letters import letter
from turnbuckle.scene.scene import Scene

TEXT = "FRICTIONLESSNESSISOVERRATEDBUTCONTACTHOLDSTHEWORLDTOGETHER"
ROOM = 1.06  # between neighbours, as a factor on the largest letter's extent
WALL = 0.2  # thickness of walls and ground [m]
COLORS = [(0.86, 0.45, 0.24), (0.95, 0.72, 0.30), (0.55, 0.66, 0.34), (0.33, 0.56, 0.66), (0.66, 0.44, 0.60)]


def letters(
    count: int = 164,
    text: str = TEXT,
    size: float = 0.3,
    depth: float = 0.1,
    youngs_modulus: float = 3e5,
    poissons_ratio: float = 0.4,
    density: float = 1000.0,
    mu: float = 0.4,
    damping: float = 0.01,
    tetrahedra: int = 140,
    font: str | None = None,
    across: int = 4,
    press_at: float = 20.0,
    press_time: float = 6.0,
    press: float = 0.4,
    seed: int = 1,
    dt: float = 0.03,
    duration: float = 40.0,
) -> Scene:
    """Rubber letters fall in layers into a box; when the pile has come to rest, the walls push in (Contact, Figure 7).

    `count` letters of `text`, repeated as needed (164 with 23,000 tetrahedra in the paper), a capital H of `size` [m]
    0.3 high, `depth` [m] 0.1 thick; each is a fine surface in about `tetrahedra` corotational tetrahedra. They start
    lying, tilted at random (`seed`), `across` by `across` a layer. From `press_at` [s] on, the four walls move inwards in
    `press_time` [s] until the box has lost the fraction `press` of its width. The paper's step is 30 ms, for 40 s.
    E = `youngs_modulus` [Pa] 3e5, nu = `poissons_ratio` 0.4, `density` [kg/m^3] 1000, friction `mu` 0.4, `damping` [s]
    0.01 times the stiffness. `font`: path of any TrueType or OpenType font, DejaVu Sans Bold when left out.
    """
    characters = [c for c in text if not c.isspace()]
    if count < 1 or not characters:
        raise InputError(f"letters: count = {count} and text = {text!r}; give at least one letter")
    if across < 1:
        raise InputError(f"letters: across = {across} must be at least 1")
    if not 0.0 <= press < 0.9:
        raise InputError(f"letters: press = {press:g} must be from 0 to 0.9")
    solids = {c: letter(c, size, depth, edge=size / 3.0, font=font) for c in dict.fromkeys(characters[:count])}
    wide = ROOM * max(float(np.linalg.norm(np.ptp(v, axis=0))) for v, _ in solids.values())
    rng = np.random.default_rng(seed)
    places, low = [], WALL
    for number in range(count):
        row, column = divmod(number % (across * across), across)
        if number % (across * across) == 0:
            layer: list[tuple[np.ndarray, Rotation, float, float]] = []
        yaw, tilt, about = rng.uniform(-180.0, 180.0), rng.uniform(4.0, 18.0), rng.uniform(0.0, 360.0)
        turn = Rotation.from_euler("zyz", [-about, tilt, about + yaw], degrees=True)
        vertices, _ = solids[characters[number % len(characters)]]
        heights = turn.apply(vertices)[:, 2]
        flat = wide * (np.array([column, row]) - 0.5 * (across - 1))
        layer.append((flat, turn, float(heights.min()), float(heights.max())))
        if len(layer) == across * across or number == count - 1:
            for middle, rotation, lowest, _ in layer:
                places.append((np.array([*middle, low - lowest]), rotation))
            low += max(top - lowest for _, _, lowest, top in layer) + 0.1 * size
    scene = Scene("letters", dt=dt, duration=duration, contact={"friction": mu})
    _add_box(scene, 0.5 * across * wide, low + 2.0 * size, press_at, press_time, press)
    for number, (place, turn) in enumerate(places):
        character = characters[number % len(characters)]
        vertices, triangles = solids[character]
        scene.add_solid(
            f"letter{number}",
            vertices=vertices,
            triangles=triangles,
            cage=tetrahedra,
            position=place,
            rotation=turn.as_rotvec(),
            youngs_modulus=youngs_modulus,
            poissons_ratio=poissons_ratio,
            density=density,
            damping=damping,
            color=COLORS[number % len(COLORS)],
        )
    return scene


def _add_box(scene: Scene, half: float, height: float, at: float, time: float, press: float) -> None:
    """Ground, and four walls that push in."""
    side = 4.0 * half
    scene.add_obstacle("ground", box=[5.0 * side, 5.0 * side, WALL], position=[0.0, 0.0, -0.5 * WALL])
    pushed = half * press
    for name, direction in (("east", (1, 0)), ("west", (-1, 0)), ("north", (0, 1)), ("south", (0, -1))):
        out = np.array([*direction, 0.0])
        thick = np.abs(out)
        extent = thick * WALL + (1.0 - thick) * np.array([side, side, 0.0]) + np.array([0.0, 0.0, height])
        start = out * (half + 0.5 * WALL) + np.array([0.0, 0.0, 0.5 * height])
        motion = {"times": [at, at + time], "positions": [start, start - out * pushed], "interpolation": "linear"}
        moving = {"trajectory": motion} if press > 0.0 and time > 0.0 else {"position": start}
        scene.add_obstacle(name, box=extent, drawn=False, **moving)
