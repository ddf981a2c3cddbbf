"""The planner of one's own on the page of planners: it keeps the contract and finds a way."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.cli.commands import app
from companion.planning.own_planners import source_of
from companion.planning.planner import Planner
from companion.planning.registry import UnknownPlannerError, make_planner
from companion.settings import PlannerSettings
from tests.docs.test_docs import blocks

MAPS = Path(__file__).resolve().parents[2] / "missions" / "maps"


@pytest.fixture
def lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    (text,) = (text for where, text in blocks("python") if where.startswith("planners.md"))
    (tmp_path / "lines.py").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "lines", raising=False)
    return "lines:Lines"


def test_the_planner_of_the_page_keeps_the_contract_and_finds_a_way(lines: str) -> None:
    before = list(sys.path)
    told = CliRunner().invoke(app, ["check-planner", lines])
    assert told.exit_code == 0, told.output
    page = (MAPS.parents[1] / "docs" / "planners.md").read_text(encoding="utf-8")
    assert told.output.strip() in page, "paste what is printed"
    where = [str(MAPS / "known-1.png"), "--start", "0,24", "--target", "20,24"]
    planned = CliRunner().invoke(app, ["plan", *where, "--planner", lines])
    assert planned.exit_code == 0 and "lines" in planned.output, planned.output
    assert sys.path == before and source_of(lines) == Path("lines.py").resolve()


def test_a_planner_that_breaks_the_contract_is_told_with_the_problem(
    lines: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = Path("lines.py").read_text(encoding="utf-8")
    Path("lines.py").write_text(text.replace("is not PathFault.NONE", "is None"), encoding="utf-8")
    told = CliRunner().invoke(app, ["check-planner", lines])
    assert told.exit_code == 3 and "its path: " in told.output and "#" in told.output
    number = told.output.rpartition("--seed ")[2].strip()
    again = CliRunner().invoke(app, ["check-planner", lines, "--problems", "1", "--seed", number])
    assert again.output == told.output


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("lines:Nothing", "planner 'lines:Nothing' cannot be loaded: AttributeError"),
        ("no_such_module:A", "cannot be loaded: ModuleNotFoundError"),
        ("lines:__name__", "is no class or function"),
        ("line", "unknown planner 'line'"),
    ],
)
def test_one_that_is_not_there_is_one_line(lines: str, name: str, says: str) -> None:
    told = CliRunner().invoke(app, ["check-planner", name])
    assert told.exit_code == 2 and says in told.output and len(told.output.splitlines()) == 1


def test_a_package_may_register_a_name(lines: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "lines-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: lines\nVersion: 1.0\n")
    (folder / "entry_points.txt").write_text("[rover_companion.planners]\nlines = lines:Lines\n")
    with pytest.raises(UnknownPlannerError):
        make_planner("lines", PlannerSettings())
    monkeypatch.syspath_prepend(str(tmp_path))
    planner: Planner = make_planner("lines", PlannerSettings())
    assert planner.name == "lines"
    with pytest.raises(UnknownPlannerError, match=r"did you mean 'lines'"):
        make_planner("liness", PlannerSettings())
