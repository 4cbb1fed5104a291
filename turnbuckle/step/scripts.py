"""Points of obstacles where contact is off: they go where their script says, or stay."""

import numpy as np

from turnbuckle.compute import host
from turnbuckle.data.model import Model
from turnbuckle.data.state import Kinematics


def follow_scripts(model: Model, now: Kinematics, ahead: Kinematics, end: float, dt: float, as_velocity: bool) -> None:
    """Write scripted points into ``ahead``, at time ``end`` [s] after a step of ``dt`` [s] from ``now``.

    ``as_velocity``: the scheme remembers a velocity, else an acceleration, which is none that anybody reads.
    """
    if not model.scripted:
        return
    before, x, v, memory = host(now.x), host(ahead.x), host(ahead.v), host(ahead.memory)
    for script in model.scripted:
        part = slice(script.begin, script.end)
        x[part] = script.positions(end) if script.moves else before[part]
        v[part] = (x[part] - before[part]) / dt if script.moves else np.zeros(3)
        memory[part] = v[part] if as_velocity else np.zeros(3)
    if not ahead.x.device.is_cpu:
        for array, values in ((ahead.x, x), (ahead.v, v), (ahead.memory, memory)):
            array.assign(values)
