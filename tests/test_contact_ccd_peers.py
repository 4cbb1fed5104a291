"""Continuous collision detection beside ipc-toolkit's, and its benchmark."""

import sys

import numpy as np
import pytest

from turnbuckle.benchmarks.ccd import built_to_meet, measure
from turnbuckle.contact.ccd_bulk import time_of_impact
from turnbuckle.data.errors import InputError


@pytest.mark.parametrize("kind", [0, 1])
def test_whatever_tight_inclusion_finds_is_found(kind):
    """Wang et al. 2021; its false alarms are as near as its tolerance, and so are ours to theirs."""
    ipctk = pytest.importorskip("ipctk")
    peer = ipctk.TightInclusionCCD(tolerance=1e-9)
    rng = np.random.default_rng(kind)
    q = rng.normal(size=(4000, 8, 3))
    q[:, 4:] = q[:, :4] + rng.choice([0.1, 1.0], (4000, 1, 1)) * q[:, 4:]
    test = peer.edge_edge_ccd if kind else peer.point_triangle_ccd
    theirs = np.array([test(*rows, min_distance=0.0)[0] for rows in q])
    hit, _ = time_of_impact(q, kind)
    assert theirs.sum() > 40
    assert hit[theirs].all()
    assert hit.sum() - theirs.sum() < 0.05 * theirs.sum() + 10


def test_benchmark_builds_queries_that_meet():
    for kind in (0, 1):
        q = built_to_meet(np.random.default_rng(0), kind, planar=True)[:1000]
        assert time_of_impact(q, kind)[0].all()
        assert not time_of_impact(q, kind, method="cubic")[0].any()


def test_benchmark_says_that_ipctk_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "ipctk", None)
    with pytest.raises(InputError, match="pip install ipctk"):
        measure()
