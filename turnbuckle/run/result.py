"""`RunResult`: the report of a run, which can show itself."""

from dataclasses import dataclass

from turnbuckle.data.report import RunReport
from turnbuckle.run.certificate_text import certificate
from turnbuckle.run.report_json import to_json


@dataclass
class RunResult(RunReport):
    """What `run` returns: a `RunReport` with two ways of writing it."""

    def certificate(self) -> str:
        """A short table for people."""
        return certificate(self)

    def to_json(self) -> str:
        """The text of the report file."""
        return to_json(self)
