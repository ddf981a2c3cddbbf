"""``rover-companion bench``: what is measured, and that nobody is flattered."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from companion.bench.aims import genetic_ratios, genetic_verdict, peer_ratios, peers_verdict
from companion.bench.cases import Case, map_case, paper_cases
from companion.bench.contestants import Contestant, our_planner
from companion.bench.measure import Entry, Limits, measure, spread_order
from companion.bench.movingai import ScenarioFileError, read_scenarios, spread
from companion.bench.peers import installed_peers
from companion.cli.commands import app
from companion.core.grid import Cell
from companion.mapping.map_files import MapError
from companion.planning.problem import Budget
from companion.settings import PlannerSettings
from tests.support.planning_maps import drawn
from tests.support.shared_data import SHARED, needs_shared

MAPS = Path(__file__).resolve().parents[3] / "missions" / "maps"
WALL = drawn("........", "....#...", "....#...", "....#...", "........", "....#...")
CASE = Case("wall", 1, WALL, ((Cell(0, 2), Cell(7, 2)),))
HONEST = {"scipy dijkstra", "nano-astar", "networkx A*", "pathfinding"}


def run(contestant: Contestant, seeds: int = 4):
    (entry,) = measure([contestant], [CASE], Limits(seeds=seeds), lambda *_: None)
    return entry


def test_an_optimal_planner_costs_what_is_possible():
    entry = run(our_planner("dijkstra", PlannerSettings(), Budget()))
    assert entry.found == entry.runs == 20 and entry.ratio == 1.0 and entry.faults == ()
    assert 0.0 < entry.median_ms <= entry.p99_ms


def test_a_random_planner_is_measured_over_seeds():
    entry = run(our_planner("bspline-ga", PlannerSettings(), Budget()), seeds=7)
    assert entry.runs == 7 and all(ratio >= 1.0 - 1e-9 for ratio in entry.ratios)


@pytest.mark.parametrize(
    ("cells", "fault"),
    [
        ([(x, 2) for x in range(8)], "obstacle"),
        ([(0, 2), (1, 2), (2, 2), (3, 2), (4, 1), (5, 2), (6, 2), (7, 2)], "corner cut"),
        ([(0, 2), (7, 2)], "not adjacent"),
        ([(0, 2), (1, 2)], "wrong ends"),
    ],
)
def test_faults_of_others_are_found(cells, fault):
    entry = run(Contestant("cheat", lambda *_: lambda: np.array(cells, np.int64)))
    assert fault in entry.faults


@pytest.mark.parametrize("count", [1, 2, 3, 4, 9, 20, 21])
def test_every_problem_comes_once_and_a_hard_one_soon(count):
    order = spread_order(count)
    assert sorted(order) == list(range(count))
    assert max(order[: (count + 2) // 3 + 1]) >= count // 2


def test_a_random_planner_meets_every_problem_however_few_the_seeds():
    asked = []

    def solve(weights, start, target, rng):
        asked.append((start, target))

    ends = tuple((Cell(0, y), Cell(7, y)) for y in range(5))
    measure([Contestant("any", solve, random=True)], [Case("wall", 1, WALL, ends)], Limits(seeds=2), lambda *_: None)
    assert set(asked) == set(ends)


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


def test_what_finds_nothing_has_no_cost():
    entry = run(Contestant("blind", lambda *_: None))
    assert entry.found == 0 and entry.ratio is None


def test_a_contestant_that_would_take_too_long_is_not_sent_to_larger_maps():
    slow = Contestant("small maps only", lambda *_: None, most_fields=10)
    assert measure([slow], [CASE], Limits(), lambda *_: None) == []


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


def test_the_four_maps_grow():
    small, large = (case for case in paper_cases(MAPS, (1, 4)) if case.name == "rooms")
    assert large.weights.shape == (200, 400) and large.fields == 16 * small.fields
    (start, target) = large.ends[0]
    assert large.weights[start.y, start.x] < 1.0 and large.weights[target.y, target.x] < 1.0


SCENARIOS = "version 1\n0\tm.map\t8\t6\t0\t3\t7\t3\t8.5\n1\tm.map\t8\t6\t0\t0\t7\t0\t7\n"


def test_scenarios_are_read_with_y_upward(tmp_path):
    file = tmp_path / "m.map.scen"
    file.write_text(SCENARIOS)
    first, second = read_scenarios(file)
    assert (first.start, first.target, first.optimum_fields) == (Cell(0, 2), Cell(7, 2), 8.5)
    assert second.start == Cell(0, 5)
    assert spread([first, second] * 50, 3) == [first, first, second]


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("hello\n", "line 1"),
        ("version 1\n0 m 8 6 0 3 7\n", "line 2"),
        ("version 1\n\n0 m 8 6 0 3 7 x 8\n", "line 3"),
    ],
)
def test_a_bad_scenario_file_names_its_line(tmp_path, text, place):
    file = tmp_path / "m.scen"
    file.write_text(text)
    with pytest.raises(ScenarioFileError, match=place):
        read_scenarios(file)


@needs_shared
def test_costs_agree_with_the_benchmark_files():
    file = SHARED / "data" / "movingai" / "dao" / "arena.map"
    case = map_case(file, 40)
    known = {(s.start, s.target): s.optimum_fields for s in read_scenarios(file.with_name("arena.map.scen"))}
    solve = our_planner("dijkstra", PlannerSettings(), Budget()).solve
    for ends in case.ends:
        cells = solve(case.weights, *ends, 0)()
        length = np.hypot(*np.diff(cells, axis=0).T).sum()
        assert length == pytest.approx(known[ends], abs=1e-4)


def test_the_command_writes_table_json_and_page(tmp_path):
    arguments = [
        "bench",
        "--sizes",
        "1",
        "--planners",
        "dijkstra,bspline-ga",
        "--no-peers",
        "--seeds",
        "3",
        "--cell-s",
        "1",
    ]
    result = CliRunner().invoke(app, [*arguments, "--json", str(tmp_path / "b.json"), "--docs", str(tmp_path / "docs")])
    assert result.exit_code == 0, result.output
    figures = json.loads((tmp_path / "b.json").read_text())
    assert {entry["contestant"] for entry in figures["entries"]} == {"dijkstra", "bspline-ga"}
    assert len(figures["maps"]) == 4 and "numpy" in figures["where"]
    assert figures["settings"]["planner"]["mixing"] == 0.8 and figures["versions"]["numba"]
    page = (tmp_path / "docs" / "benchmarks.md").read_text()
    assert "\n3 with seeds 0 to 2 of planners that draw random numbers, 20 of others" in page
    assert "3 with seeds 0 to 2" in " ".join(result.output.split())
    assert "astar against" not in page, "nothing to compare"
    assert "## rooms (100 x 50 fields)" in page and "| dijkstra |" in page
    assert (tmp_path / "docs" / "images" / "benchmarks.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--sizes", "one"], "--sizes one"),
        (["--sizes", "1000"], "--sizes 1000"),
        (["--sizes", ""], "nothing to measure"),
        (["--sizes", "1", "--planners", "dijkstar"], "'dijkstra'"),
        (["--sizes", "1", "none.map"], "none.map"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(arguments, words):
    result = CliRunner().invoke(app, ["bench", "--no-peers", *arguments])
    assert result.exit_code == 2
    assert words in result.output and result.output.count("\n") == 1


def test_a_map_without_problems_is_refused(tmp_path):
    file = tmp_path / "m.map"
    file.write_text("type octile\nheight 1\nwidth 2\nmap\n..\n")
    with pytest.raises(MapError, match="scenario file"):
        map_case(file, 5)
