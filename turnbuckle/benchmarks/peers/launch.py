"""Running the peers, each in a process of its own: a crash, a hang or a missing package of theirs is a line of text."""

import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from turnbuckle.benchmarks.peers.chain_protocol import ChainResult
from turnbuckle.benchmarks.peers.protocol import PeerResult

TIMEOUT = 150.0  # [s]; compiling on first use included


@dataclass(frozen=True)
class Peer:
    """A script of this package that simulates the curtain or the chain."""

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


CHAIN_PEERS = (
    Peer("mujoco connect", "mujoco", ("chain_mujoco", "--joints", "connect")),
    Peer("mujoco tree", "mujoco", ("chain_mujoco", "--joints", "tree")),
    Peer("newton xpbd", "newton", ("chain_newton",)),
)


def run_peer(peer: Peer, m: int, dt: float, seconds: float = 10.0) -> PeerResult | str:
    """The peer's answer for `curtain(m)` in steps of dt [s], or a sentence why there is none."""
    answers = _answers(peer, ("--m", str(m), "--dt", repr(dt), "--seconds", repr(seconds)))
    results = [PeerResult(**answer) for answer in answers if not isinstance(answer, str)]
    return min(results, key=lambda result: result.ms_per_step) if results else str(answers[0])


def run_chain_peer(peer: Peer, n: int, seconds: float = 10.0) -> ChainResult | str:
    """The peer's answer for `closed_chain(n)`, or a sentence why there is none."""
    answers = _answers(peer, ("--n", str(n), "--seconds", repr(seconds)))
    results = [ChainResult(**answer) for answer in answers if not isinstance(answer, str)]
    return min(results, key=lambda result: result.ms_per_step) if results else str(answers[0])


def _answers(peer: Peer, task: Sequence[str]) -> list[dict[str, Any] | str]:
    """What the peer's script prints in each of its environments, or why it does not."""
    if importlib.util.find_spec(peer.package) is None:
        return [f"{peer.name} skipped: pip install {peer.package}"]
    return [_run(peer, environment, task) for environment in peer.environments]


def _run(peer: Peer, environment: dict[str, str], task: Sequence[str]) -> dict[str, Any] | str:
    module, *rest = peer.arguments
    command = [sys.executable, "-m", f"turnbuckle.benchmarks.peers.{module}", *rest, *task]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, env=os.environ | environment)
    except subprocess.TimeoutExpired:
        return f"{peer.name} skipped: no answer in {TIMEOUT:.0f} s"
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return f"{peer.name} failed with exit code {done.returncode}: {last}"
    return json.loads(done.stdout.strip().splitlines()[-1])


def curtain_peers(m: int, dt: float) -> Iterator[PeerResult | str]:
    """All peers, one after the other: they must not share the processors with each other."""
    for peer in CURTAIN_PEERS:
        yield run_peer(peer, m, dt)


def chain_peers(sizes: dict[str, Sequence[int]]) -> Iterator[ChainResult | str]:
    """All peers at their sizes (name -> numbers of boxes), one after the other."""
    for peer in CHAIN_PEERS:
        for n in sizes.get(peer.name, ()):
            yield run_chain_peer(peer, n)
