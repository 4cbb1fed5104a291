"""Running the peers, each in a process of its own: a crash, a hang or a missing package of theirs is a line of text."""

import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass

from turnbuckle.benchmarks.peers.protocol import PeerResult

TIMEOUT = 150.0  # [s]; compiling on first use included


@dataclass(frozen=True)
class Peer:
    """A script of this package that simulates the curtain."""

    name: str
    package: str  # what has to be installed
    arguments: tuple[str, ...]
    environments: tuple[dict[str, str], ...] = ({},)  # all are tried, the quickest counts


CURTAIN_PEERS = (
    # With OpenMP on all processors, where one is busy elsewhere, a step can take a hundred times as long as on one.
    Peer("pypbd", "pypbd", ("curtain_pypbd",), ({}, {"OMP_NUM_THREADS": "1"})),
    Peer("newton vbd", "newton", ("curtain_newton", "--solver", "vbd")),
    Peer("newton xpbd", "newton", ("curtain_newton", "--solver", "xpbd")),
)


def run_peer(peer: Peer, m: int, dt: float, seconds: float = 10.0) -> PeerResult | str:
    """The peer's answer for `curtain(m)` in steps of dt [s], or a sentence why there is none."""
    if importlib.util.find_spec(peer.package) is None:
        return f"{peer.name} skipped: pip install {peer.package}"
    answers = [_run(peer, environment, m, dt, seconds) for environment in peer.environments]
    results = [answer for answer in answers if isinstance(answer, PeerResult)]
    return min(results, key=lambda result: result.ms_per_step) if results else answers[0]


def _run(peer: Peer, environment: dict[str, str], m: int, dt: float, seconds: float) -> PeerResult | str:
    module, *rest = peer.arguments
    command = [sys.executable, "-m", f"turnbuckle.benchmarks.peers.{module}", *rest]
    command += ["--m", str(m), "--dt", repr(dt), "--seconds", repr(seconds)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, env=os.environ | environment)
    except subprocess.TimeoutExpired:
        return f"{peer.name} skipped: no answer in {TIMEOUT:.0f} s"
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return f"{peer.name} failed with exit code {done.returncode}: {last}"
    return PeerResult(**json.loads(done.stdout.strip().splitlines()[-1]))


def curtain_peers(m: int, dt: float) -> Iterator[PeerResult | str]:
    """All peers, one after the other: they must not share the processors with each other."""
    for peer in CURTAIN_PEERS:
        yield run_peer(peer, m, dt)
