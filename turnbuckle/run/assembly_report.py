"""What `assemble` and `pose` say of their work."""

from dataclasses import dataclass, field

SHOWN = 12  # joints named in the text


@dataclass(frozen=True)
class OpenJoint:
    """A joint or constraint that cannot close."""

    name: str
    gap: float  # [m]
    angle: float  # [rad]


@dataclass
class AssemblyReport:
    """How an assembly went. Gaps are those of the scene returned."""

    closed: bool  # all within the tolerance
    tolerance: float  # [m and rad]
    joints: int  # joints and point constraints that were to close
    gap: float  # largest left [m]
    angle: float  # largest left [rad]
    start_gap: float  # largest at the start [m]
    start_angle: float  # [rad]
    iterations: int  # in displacements
    steps: int  # of Newton
    attempts: int
    seconds: float  # wall time
    open: list[OpenJoint] = field(default_factory=list)  # what is further open than the tolerance, the worst first
    messages: list[str] = field(default_factory=list)

    @property
    def status(self) -> str:
        """ "closed" or "open"."""
        return "closed" if self.closed else "open"

    def text(self) -> str:
        """The report for a person to read."""
        lines = [
            f"{self.joints} joints and point constraints, "
            f"at first up to {self.start_gap:.3g} m and {self.start_angle:.3g} rad open",
            f"{self.iterations} iterations in displacements, {self.steps} Newton steps, {self.seconds:.2f} s",
            f"{'closed' if self.closed else 'NOT CLOSED'}: largest gap {self.gap:.2e} m and {self.angle:.2e} rad",
        ]
        for joint in self.open[:SHOWN]:
            turned = f" and {joint.angle:.3g} rad" if joint.angle > self.tolerance else ""
            lines.append(f"  '{joint.name}' cannot close: {joint.gap:.3g} m{turned} are left")
        if len(self.open) > SHOWN:
            lines.append(f"  and {len(self.open) - SHOWN} more")
        return "\n".join(lines + self.messages)
