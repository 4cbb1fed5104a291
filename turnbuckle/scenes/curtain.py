"""A curtain of cubes, nailed at its top row: Local, Figures 1 and 2."""

from turnbuckle.scene.scene import Scene
from turnbuckle.scenes.curtain_geometry import curtain_geometry


def curtain(
    m: int = 40,
    rows: int = 20,
    edge: float = 0.1,
    push: float = 2.0,
    release_at: float | None = None,
    stiffness: float = 50.0,
    damping: float = 0.02,
    density: float = 1000.0,
    dt: float = 1e-3,
    duration: float = 4.0,
) -> Scene:
    """A curtain of cubes hangs from nails, sways, and falls apart when it is released (Local, Figures 1 and 2).

    `rows` rows alternate m and m - 1 cubes of length `edge` [m] that touch corner to corner. The top is nailed, the
    corners that touch are joined. It starts with the speed `push` [m/s] along z. At `release_at` [s] all constraints
    end at once and the cubes fall one by one (second picture of Figure 1); None: never.
    `stiffness` [J] and `damping` [J s] are those of distance, area and volume alike; `density` in kg/m^3.

    Counts, as in the paper: m = 40: 790 cubes, 3950 tetrahedra, 160 nails, 2964 points to point. m = 150: 2990 cubes,
    14950 tetrahedra, 11924 constraints. m = 500: 9990 cubes, 49950 tetrahedra, 39924 constraints.
    """
    geometry = curtain_geometry(m, rows, edge)
    scene = Scene("curtain", up_axis="Y", dt=dt, duration=duration)
    scene.add_solid(
        "cubes",
        vertices=geometry.vertices,
        tetrahedra=geometry.tetrahedra,
        velocity=[0.0, 0.0, push],
        density=density,
        k_distance=stiffness,
        k_area=stiffness,
        k_volume=stiffness,
        damping_distance=damping,
        damping_area=damping,
        damping_volume=damping,
    )
    window = {} if release_at is None else {"end": release_at}
    scene.add_constraint("nail", "nails", points={"body": "cubes", "indices": geometry.nails}, **window)
    if rows > 1:
        sides = [{"body": "cubes", "indices": side} for side in geometry.pairs.T]
        scene.add_constraint("points_to_point", "joints", zip=sides, **window)
    return scene
