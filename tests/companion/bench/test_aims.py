"""What was aimed at, and every miss named."""

import pytest

from companion.bench.aims import genetic_ratios, genetic_verdict, peer_ratios, peers_verdict
from companion.bench.contestants import Contestant
from companion.bench.measure import Entry


def entry(name: str, case: str, scale: int, ms: float, found: int = 10) -> Entry:
    return Entry(name, case, scale, 10, found, (ms,), (1.0,) * found, (), None)


def test_what_was_aimed_at_is_said_and_every_miss_named():
    entries = [
        entry("astar", "rooms", 1, 1.0),
        entry("astar", "one-obstacle", 40, 8.0),
        entry("bspline-ga", "one-obstacle", 40, 0.1, found=9),
        entry("sampler", "rooms", 1, 0.1),
        entry("library", "rooms", 1, 2.0),
        entry("slow", "rooms", 1, 9.0),
        entry("library", "one-obstacle", 40, 80.0),
    ]
    peers = [Contestant(name, lambda *_: None) for name in ("library", "slow")]
    peers.append(Contestant("sampler", lambda *_: None, random=True))
    ratios = peer_ratios(entries, peers)
    assert ratios == [("rooms", 1, "library", 2.0), ("one-obstacle", 40, "library", 10.0)]
    assert peers_verdict(ratios).endswith("Not reached: rooms x1 (2.00).")
    assert peers_verdict(ratios[1:]).endswith("Reached.")
    assert genetic_ratios(entries) == [("one-obstacle", 40, pytest.approx(80.0), 0.9)]
    assert genetic_verdict(genetic_ratios(entries)).endswith("Reached.")
    slower = [entry("astar", "one-obstacle", 1, 0.5), entry("bspline-ga", "one-obstacle", 1, 1.0)]
    assert genetic_verdict(genetic_ratios(slower)).endswith("Not reached: x1 (0.50).")
