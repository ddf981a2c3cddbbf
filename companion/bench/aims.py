"""The aims of the benchmarks, and whether measured ratios reach them: within one run, with every miss named."""

from __future__ import annotations

from companion.bench.contestants import Contestant
from companion.bench.measure import Entry

PEER_FACTOR = 3.0
"""How many times as fast as the fastest complete peer ``astar`` should be, on every map at every size."""
GENETIC_FACTORS = {1: 1.0, 40: 50.0}
"""How many times as fast as ``astar`` the genetic algorithm should be on the map with one obstacle, by size."""
EASY_MAP = "one-obstacle"


def fastest_peer(entries: list[Entry], contestants: list[Contestant], case: str, scale: int) -> Entry | None:
    """The fastest peer without random numbers (only these always find a path), faults or not; None: none took part."""
    complete = {contestant.name for contestant in contestants if not contestant.ours and not contestant.random}
    own = [entry for entry in entries if (entry.case, entry.scale) == (case, scale) and entry.contestant in complete]
    return min((entry for entry in own if entry.found), key=lambda entry: entry.median_ms, default=None)


def peer_ratios(entries: list[Entry], contestants: list[Contestant]) -> list[tuple[str, int, str, float]]:
    """For each map and size: the fastest complete peer and its time over that of ``astar``."""
    found = []
    for entry in entries:
        if entry.contestant == "astar":
            peer = fastest_peer(entries, contestants, entry.case, entry.scale)
            if peer is not None:
                found.append((entry.case, entry.scale, peer.contestant, peer.median_ms / entry.median_ms))
    return found


def genetic_ratios(entries: list[Entry]) -> list[tuple[str, int, float, float]]:
    """For each map and size: the time of ``astar`` over that of ``bspline-ga``, and how often that finds a path."""
    times = {(entry.contestant, entry.case, entry.scale): entry for entry in entries}
    found = []
    for entry in entries:
        graph = times.get(("astar", entry.case, entry.scale))
        if entry.contestant == "bspline-ga" and graph is not None:
            found.append((entry.case, entry.scale, graph.median_ms / entry.median_ms, entry.found / entry.runs))
    return found


def peers_verdict(ratios: list[tuple[str, int, str, float]]) -> str:
    """One sentence for people."""
    return _verdict(
        f"Aimed at: {PEER_FACTOR:g} times as fast as the fastest complete peer everywhere.",
        [f"{name} x{scale} ({ratio:.2f})" for name, scale, _, ratio in ratios if ratio < PEER_FACTOR],
    )


def genetic_verdict(ratios: list[tuple[str, int, float, float]]) -> str:
    """One sentence for people; empty where none of the sizes that count was measured."""
    own = [(scale, ratio) for name, scale, ratio, _ in ratios if name == EASY_MAP and scale in GENETIC_FACTORS]
    if not own:
        return ""
    wanted = " and ".join(
        f"{factor:g} times as fast as `astar` at x{scale}" for scale, factor in GENETIC_FACTORS.items()
    )
    missed = [f"x{scale} ({ratio:.2f})" for scale, ratio in own if ratio <= GENETIC_FACTORS[scale]]
    return _verdict(f"Aimed at on {EASY_MAP}: more than {wanted}.", missed)


def _verdict(aim: str, missed: list[str]) -> str:
    return f"{aim} {'Not reached: ' + ', '.join(missed) if missed else 'Reached'}."
