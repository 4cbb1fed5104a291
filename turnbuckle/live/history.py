"""The last seconds of a run as columns: what the plots show."""

import numpy as np

from turnbuckle.data.report import StepReport

LENGTH = 600  # samples kept
STAGES = ("forces", "integration", "constraints", "joints", "detection", "rows", "contact_solve", "ccd", "report")


class History:
    """A ring of samples, each a row of numbers by name; what a step does not tell is NaN."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._rows: list[dict[str, float]] = []
        self.added = 0  # steps ever

    def add(self, report: StepReport) -> None:
        """A step."""
        row = {"time": report.time, "residual": report.worst_residual, "rounds": float(report.rounds)}
        row["iterations"] = float(sum(report.iterations.values()))
        row["contacts"] = float(report.touching)
        energies = {name: value for name, value in report.energies.items() if np.isfinite(value)}
        row |= energies
        row["total"] = sum(value for name, value in energies.items() if name in ("kinetic", "elastic", "gravity"))
        row |= {f"ms {stage}": 1e3 * seconds for stage, seconds in report.seconds.items()}
        self._rows.append(row)
        self.added += 1
        if len(self._rows) >= 2 * LENGTH:
            del self._rows[:-LENGTH]

    def columns(self, *names: str) -> tuple[np.ndarray, ...]:
        """The newest samples of each name, (k,) each, k at most `LENGTH`."""
        rows = self._rows[-LENGTH:]
        return tuple(np.array([row.get(name, np.nan) for row in rows], dtype=np.float64) for name in names)

    def stages(self) -> list[str]:
        """Stages that took any time."""
        seen = {name[3:] for row in self._rows[-20:] for name in row if name.startswith("ms ")} - {"total"}
        return [s for s in STAGES if s in seen] + sorted(seen - set(STAGES))

    def __len__(self) -> int:
        return min(len(self._rows), LENGTH)
