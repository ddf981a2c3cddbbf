"""Search libraries that people use: each finds the way, and says when there is none."""

import numpy as np
import pytest

from companion.bench.peers import PEERS
from companion.core.grid import Cell
from tests.companion.bench.test_measure import run
from tests.support.planning_maps import drawn

HONEST = {"scipy dijkstra", "nano-astar", "networkx A*", "pathfinding"}


@pytest.mark.parametrize("module", PEERS)
def test_every_installed_peer_finds_the_way_round_and_says_when_there_is_none(module):
    pytest.importorskip(module)
    closed = drawn("...#...", "...#...", "...#...")
    for peer in PEERS[module]():
        entry = run(peer, seeds=2)
        assert entry.found == entry.runs > 0, peer.name
        if peer.name in HONEST:
            assert entry.ratio == pytest.approx(1.0) and entry.faults == (), peer.name
        if "OMPL" not in peer.name:  # samples until its time is over
            assert peer.solve(closed, Cell(0, 1), Cell(6, 1), np.random.default_rng(0)) is None, peer.name
