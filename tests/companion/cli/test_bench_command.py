"""``rover-companion bench``: what it writes, and what it refuses."""

import json

import pytest
from typer.testing import CliRunner

from companion.cli.commands import app


@pytest.mark.thorough
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
        (["--sizes", "1", "--start", "0,24", "--target", "98,24"], "on which map?"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(arguments, words):
    result = CliRunner().invoke(app, ["bench", "--no-peers", *arguments])
    assert result.exit_code == 2
    assert words in result.output and result.output.count("\n") == 1


def test_two_ends_do_where_there_is_no_scenario_file(tmp_path):
    (tmp_path / "small.map").write_text("type octile\nheight 3\nwidth 5\nmap\n.....\n..@..\n.....\n")
    figures = tmp_path / "b.json"
    command = ["bench", str(tmp_path / "small.map"), "--planners", "astar", "--no-peers"]
    result = CliRunner().invoke(app, [*command, "--start", "0,1", "--target", "4,1", "--json", str(figures)])
    assert result.exit_code == 0, result.output
    (entry,) = json.loads(figures.read_text())["entries"]
    assert entry["contestant"] == "astar"
    for more, words in (
        ([], "give --start and --target, or a MovingAI scenario file beside it (small.map.scen)"),
        (["--start", "0,1"], "--start and --target go together"),
        (["--start", "2,1", "--target", "4,1"], "on an obstacle, choose a free field"),
        (["--start", "0,9", "--target", "4,1"], "outside the map, which has fields 0,0 to 4,2"),
    ):
        refused = CliRunner().invoke(app, [*command, *more])
        assert refused.exit_code == 2 and words in refused.output, refused.output
