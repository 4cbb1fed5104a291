"""A piece of cloth falls on its edge and folds: Contact, Figure 5."""

import numpy as np
from scipy.spatial.transform import Rotation

from turnbuckle.data.errors import InputError
from turnbuckle.scene.scene import Scene


def falling_cloth(
    mu: float = 0.3,
    cells: int = 49,
    size: float = 1.0,
    density: float = 0.2,
    stiffness: float = 400.0,
    bend_stiffness: float = 3e-5,
    damping: float = 0.02,
    height: float = 0.05,
    tilt: float = 12.0,
    dt: float = 4e-3,
    duration: float = 4.0,
) -> Scene:
    """A square of cloth falls on its edge and lays itself in folds on the ground (Contact, Figure 5).

    A sheet of `size` [m] and `cells` cells a side (49: 2,500 vertices, as in the paper) hangs on its edge `height` [m]
    over the ground, leaning by `tilt` [degrees], and is let go. Folds stack on folds. `mu` 0.3 is the friction of cloth
    on cloth and on the ground: at 0.05 the heap spreads, at 0.6 it stands higher.
    `density` [kg/m^2] 0.2, springs along edges and diagonals of `stiffness` [N/m] 400 and `damping` [N s/m], bending by
    the angle between triangles, `bend_stiffness` [N m/rad] 3e-5. The paper's step is 4 ms, for 4 s.
    """
    if not (size > 0.0 and height > 0.0):
        raise InputError(f"falling_cloth: size = {size:g} m and height = {height:g} m must be positive")
    if not abs(tilt) < 90.0:
        raise InputError(f"falling_cloth: tilt = {tilt:g} degrees must be between -90 and 90")
    scene = Scene("falling_cloth", dt=dt, duration=duration, contact={"friction": mu})
    scene.add_obstacle("ground", plane=[10.0 * size, 10.0 * size])
    # On its edge, leaning, one corner first: no two rows of the cloth arrive together.
    turn = Rotation.from_euler("xyz", [90.0 - tilt, 4.0, 10.0], degrees=True)
    corners = turn.apply(size * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]))
    place = [*(-corners.mean(axis=0)[:2]), height - corners[:, 2].min()]
    scene.add_cloth(
        "cloth",
        size=[size, size],
        cells=[cells, cells],
        position=place,
        rotation=turn.as_rotvec(),
        density=density,
        structural_stiffness=stiffness,
        shear_stiffness=stiffness,
        bend_model="hinges",
        bend_stiffness=bend_stiffness,
        damping=damping,
        color=[0.72, 0.20, 0.22],
    )
    return scene
