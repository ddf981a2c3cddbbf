"""The experiment ``sedighi-table1``: what it writes, and what it says about bad grids."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.core.grid import Cell
from companion.planning.problem import Path as Path_
from sitl.cli.commands import app
from sitl.experiments.experiment import Options
from sitl.experiments.sedighi_table1 import METHODS, PAPER_PERCENT, TableReport, run, turns


@pytest.fixture(scope="module")
def grids(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("grids")
    (folder / "tiny.txt").write_text("3\n000\n110\n000", encoding="utf-8")
    (folder / "shut.txt").write_text("2\n01\n10", encoding="utf-8")
    (folder / "notes.txt").write_text("no grid", encoding="utf-8")
    (folder / "SOURCE.txt").write_text("repo: https://example.org/grids  (tests/)", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def report(grids: Path) -> TableReport:
    calls: list[tuple[int, int]] = []
    made = run(Options(runs=1, maps=grids), lambda done, total: calls.append((done, total)))
    assert calls[-1] == (40, 40)
    return made


def test_what_was_searched_and_found(report: TableReport):
    assert [*report.spaces] == [*PAPER_PERCENT, "shut", "tiny"]
    figures = json.loads(json.dumps(report.as_json()))
    found = {(row["space"], row["method"]): row["found"] for row in figures["results"]}
    assert found["tiny", "sedighi"] == [True] and found["shut", "sedighi"] == [False]
    assert found["SPSet07", "geisler"] == found["SPSet07", "hermanu"] == [False]
    assert len(report.tables()) == 2


def test_the_local_search_stands_beside_the_papers_methods(report: TableReport):
    row = next(line for line in report.section().splitlines() if line.startswith("| SPSet07"))
    local, whole = (report.entry("SPSet07", method).percent(1) for method in ("sedighi-local", "sedighi"))
    assert row.split(" | ")[-2:] == [f"{whole:.1f} (86.7)", f"{local:.1f} |"]


def test_spaces_that_only_the_search_over_the_whole_square_crosses_are_named(report: TableReport):
    assert not report.entry("SPSet06", "sedighi-local").paths() and report.entry("SPSet06", "sedighi").paths()
    assert "`sedighi-local` never crosses SPSet06, " in report.section()


def test_where_the_switches_are_not_found_the_local_search_is_counted(tmp_path: Path):
    corners = """10
0000000000
0111111111
0100000000
0101111110
0101000000
0101011111
0101010000
0101010110
0101010100
0001000100"""
    (tmp_path / "corners.txt").write_text(corners, encoding="utf-8")
    text = run(Options(runs=1, maps=tmp_path), lambda done, total: None).section()
    assert "a way over corners with its 2 switches" in text and "`sedighi-local` found one in 0 of 1\n" in text


def test_what_is_written(report: TableReport, tmp_path: Path):
    picture, page = report.write_docs(tmp_path)
    text = page.read_text(encoding="utf-8")
    assert picture.stat().st_size > 5000 and "73.3" in text and "tiny" in text
    assert all(name in text for name in (*METHODS, *PAPER_PERCENT))
    folder = report.options.maps
    assert folder is not None and f"--maps {folder.name} --docs" in text, "the command names the folder"
    assert f"The same for the grids of `{folder.name}`, from https://example.org/grids (text files" in text


def test_the_same_seeds_find_the_same_paths(report: TableReport, grids: Path):
    again = run(Options(runs=1, maps=grids), lambda done, total: None)
    for one, other in zip(report.entries, again.entries, strict=True):
        assert [path.cells for path in one.paths()] == [path.cells for path in other.paths()]


def test_turns_are_counted():
    cells = (Cell(0, 0), Cell(1, 0), Cell(2, 0), Cell(2, 1), Cell(3, 1), Cell(3, 0))
    assert turns(Path_(cells, 0.0)) == 3
    assert turns(Path_(cells[:1], 0.0)) == turns(Path_(cells[:3], 0.0)) == 0


def test_a_folder_without_grids_is_named(tmp_path: Path):
    result = CliRunner().invoke(app, ["experiment", "sedighi-table1", "--maps", str(tmp_path)])
    assert result.exit_code == 2 and str(tmp_path) in result.stderr and len(result.stderr.splitlines()) == 1
    result = CliRunner().invoke(app, ["experiment", "sedighi-table1", "--maps", str(tmp_path / "none")])
    assert result.exit_code == 2 and "no such folder" in result.stderr
