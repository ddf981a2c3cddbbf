"""Search libraries that people use: each finds the way, and says when there is none."""

import numpy as np
import pytest

from companion.bench.peers import installed_peers
from companion.core.grid import Cell
from tests.companion.bench.test_measure import run
from tests.support.planning_maps import drawn

HONEST = {"scipy dijkstra", "nano-astar", "networkx A*", "pathfinding"}


@pytest.mark.parametrize("peer", installed_peers()[0], ids=lambda peer: peer.name)
def test_every_installed_peer_finds_the_way_round(peer):
    entry = run(peer, seeds=2)
    assert entry.found == entry.runs > 0
    if peer.name in HONEST:
        assert entry.ratio == pytest.approx(1.0) and entry.faults == ()


@pytest.mark.parametrize("peer", [p for p in installed_peers()[0] if "OMPL" not in p.name], ids=lambda peer: peer.name)
def test_a_peer_says_when_there_is_no_path(peer):
    closed = drawn("...#...", "...#...", "...#...")
    assert peer.solve(closed, Cell(0, 1), Cell(6, 1), np.random.default_rng(0)) is None
