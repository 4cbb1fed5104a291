"""Forces of rows, written into the tables they come from."""

import numpy as np

from turnbuckle.constraints import rows as constraint_rows
from turnbuckle.data.state import State


def write_row_forces(state: State, rows: constraint_rows.Rows, force: np.ndarray, add: bool) -> None:
    """Write the forces of rows [N] into their tables: on the (first) point of each constraint."""
    for place, kind in enumerate(constraint_rows.KINDS):
        mine = rows.kind == place
        if not mine.any():
            continue
        table = getattr(state.tables, kind)
        f, row = force[mine], rows.row[mine]
        total = table.force.numpy()
        if kind == "points_to_point":  # a row ties one point to the first
            per_point, offsets = table.point_force.numpy(), table.offsets.numpy()
            if not add:
                which = np.unique(row)
                total[which] = 0.0
                per_point[offsets[which]] = 0.0
                per_point[offsets[row] + rows.point[mine]] = 0.0
            per_point[offsets[row] + rows.point[mine]] += f
            np.subtract.at(per_point, offsets[row], f)
            total[np.unique(row)] = per_point[offsets[np.unique(row)]]
            table.point_force.assign(per_point)
        elif add:
            total[row] += f
        else:
            total[row] = f
        table.force.assign(total)
