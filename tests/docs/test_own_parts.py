"""Parts of one's own, as on the pages: the planner keeps the contract, the controller drives, the world has a way."""

from __future__ import annotations

import json
import re
import sys
import time
from pathlib import Path

import pytest
from pydantic import ValidationError
from typer import Typer
from typer.testing import CliRunner

from companion.cli import check_planner
from companion.cli.commands import app
from companion.control.motion_planners import motion_planner
from companion.core.own_parts import OwnKind, OwnPartError, source_of
from companion.mission.load import load_mission
from companion.planning.planner import Planner
from companion.planning.registry import UnknownPlannerError, make_planner
from companion.settings import PlannerSettings, Settings
from sitl.campaign.worded import GroundSpec
from sitl.cli.commands import app as sitl
from sitl.generators.made_ground import made as ground_of
from tests.docs.test_docs import blocks

MAPS = Path(__file__).resolve().parents[2] / "missions" / "maps"


@pytest.fixture
def lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    return written("planners.md", "Lines", tmp_path, monkeypatch)


def written(page: str, name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The page's class in a file of its own in the present folder; ``module:name`` of it."""
    (text,) = (text for where, text in blocks("python") if where.startswith(page) and f"class {name}" in text)
    module = name.lower()
    (folder / f"{module}.py").write_text(text, encoding="utf-8")
    monkeypatch.chdir(folder)
    monkeypatch.delitem(sys.modules, module, raising=False)
    return f"{module}:{name}"


def test_the_planner_of_the_page_keeps_the_contract_and_finds_a_way(lines: str) -> None:
    before = list(sys.path)
    told = CliRunner().invoke(app, ["check-planner", lines])
    assert told.exit_code == 0, told.output
    page = (MAPS.parents[1] / "docs" / "planners.md").read_text(encoding="utf-8")
    assert told.output.strip() in page, "paste what is printed"
    where = [str(MAPS / "known-1.png"), "--start", "0,24", "--target", "20,24"]
    planned = CliRunner().invoke(app, ["plan", *where, "--planner", lines])
    assert planned.exit_code == 0 and "lines" in planned.output, planned.output
    assert sys.path == before and source_of(OwnKind.PLANNER, lines) == Path("lines.py").resolve()


def test_the_planner_of_the_page_drives(lines: str, tmp_path: Path) -> None:
    mission = str(MAPS.parent / "first-drive" / "five-metres.toml")
    driven = CliRunner().invoke(sitl, ["drive", mission, "--planner", lines, "--json", "drive.json", "--record", "rec"])
    assert driven.exit_code == 0, driven.output
    assert json.loads(Path("drive.json").read_text())["settings"]["navigator"]["planner"] == lines
    replayed = CliRunner().invoke(app, ["replay", "rec"])
    assert replayed.exit_code == 0 and "differences: none" in replayed.output, replayed.output


@pytest.mark.parametrize("fails", ['raise ValueError("my bug")', "raise SystemExit(0)"])
def test_a_planner_that_fails_on_the_way_ends_the_drive_with_one_line(lines: str, fails: str) -> None:
    """By itself SystemExit(0) would end it as if every target had been reached. Three searches go well, two of them at
    the start."""
    text = Path("lines.py").read_text(encoding="utf-8")
    late = f"Lines.calls = getattr(Lines, 'calls', 0) + 1\n        if Lines.calls > 3: {fails}\n        fields = poly"
    Path("lines.py").write_text(text.replace("fields = poly", late), encoding="utf-8")
    mission = str(MAPS.parent / "first-drive" / "five-metres.toml")
    driven = CliRunner().invoke(sitl, ["drive", mission, "--planner", lines, "--record", "rec"])
    assert isinstance(driven.exception, OwnPartError), driven.output
    error = fails.removeprefix("raise ").replace('("', ": ").replace('")', "").replace("(0)", ": 0")
    assert re.fullmatch(rf"planner 'lines:Lines' fails: {error} \(lines.py, line \d+\)", str(driven.exception))
    replayed = CliRunner().invoke(app, ["replay", "rec"])
    assert "tick" in replayed.output, replayed.output


@pytest.mark.parametrize(
    "command", [(sitl, "drive", []), (app, "run", ["--connect", "udpin:127.0.0.1:0", "--state", "state"])]
)
def test_a_planner_that_is_not_there_is_refused_as_an_option(
    command: tuple[Typer, str, list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    program, name, options = command
    told = CliRunner().invoke(program, [name, str(MAPS.parent / "open.toml"), "--planner", "astr", *options])
    assert told.exit_code == 2 and told.output.startswith("--planner: unknown planner 'astr', did you mean 'astar'?")


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


def test_a_planner_that_ends_the_program_is_told_in_one_line_with_the_problem(lines: str) -> None:
    text = Path("lines.py").read_text(encoding="utf-8")
    Path("lines.py").write_text(text.replace("fields = poly", "raise SystemExit(0)\n        fields = poly"))
    told = CliRunner().invoke(app, ["check-planner", lines])
    assert told.exit_code == 3, told.output
    assert told.output.startswith("lines:Lines: problem 0: it raised SystemExit: 0 (lines.py, line ")
    sys.modules.pop("lines")
    Path("lines.py").write_text("raise SystemExit(0)\n")
    told = CliRunner().invoke(app, ["check-planner", lines])
    assert told.exit_code == 2
    assert told.output == "planner 'lines:Lines' cannot be loaded: SystemExit: 0\n"


def test_a_planner_that_never_finds_a_path_is_told_with_the_first_problem(lines: str) -> None:
    text = Path("lines.py").read_text(encoding="utf-8")
    Path("lines.py").write_text(text.replace("is not PathFault.NONE", "is not None"), encoding="utf-8")
    told = CliRunner().invoke(app, ["check-planner", lines, "--problems", "20"])
    assert told.exit_code == 3, told.output
    assert re.search(r"no path in any of \d+ problems that have one; the first, problem \d+:\n[.#ST]+\n", told.output)


@pytest.mark.parametrize(
    ("when", "whose"),
    [
        ("Lines.calls > 63", "asked again after the other problems"),
        ("id(self) != Lines.first", "made anew"),
    ],
)
def test_a_planner_that_answers_otherwise_later_is_told(lines: str, when: str, whose: str) -> None:
    """For each of the 21 problems it is asked three times, but for those with ends on obstacles, and then again."""
    text = Path("lines.py").read_text(encoding="utf-8")
    late = (
        "Lines.calls, Lines.first = getattr(Lines, 'calls', 0) + 1, getattr(Lines, 'first', id(self))\n"
        f"        if {when}: return None, 1, 0, 0\n        fields = poly"
    )
    Path("lines.py").write_text(text.replace("fields = poly", late), encoding="utf-8")
    told = CliRunner().invoke(app, ["check-planner", lines, "--problems", "20"])
    assert told.exit_code == 3 and f"{whose} it gave another path for the same seed" in told.output, told.output


def test_a_planner_that_fails_on_a_large_map_only_is_told(lines: str) -> None:
    text = Path("lines.py").read_text(encoding="utf-8")
    fails = "if weights.size > 1000: raise ValueError('too large')\n        fields = poly"
    Path("lines.py").write_text(text.replace("fields = poly", fails), encoding="utf-8")
    told = CliRunner().invoke(app, ["check-planner", lines, "--problems", "20"])
    assert told.exit_code == 3 and "it raised ValueError: too large (lines.py, line " in told.output, told.output


@pytest.mark.parametrize(
    ("promise", "wrong", "shown"),
    [
        ("moving_obstacles", "it promises moving_obstacles, and it meets one", "a disc of radius 1.5 fields moves"),
        ("turning_radius", "it promises turning_radius, and its line", "turning radius "),
        ("speeds, any_angle", "", ""),
    ],
)
def test_a_promise_that_is_not_kept_is_told_with_the_problem(lines: str, promise: str, wrong: str, shown: str) -> None:
    text = Path("lines.py").read_text(encoding="utf-8")
    promises = ", ".join(f"{one}=True" for one in promise.split(", "))
    Path("lines.py").write_text(text.replace("Capabilities()", f"Capabilities({promises})"), encoding="utf-8")
    told = CliRunner().invoke(app, ["check-planner", lines, "--problems", "20"])
    assert told.exit_code == (3 if wrong else 0) and wrong in told.output and shown in told.output, told.output


def test_a_planner_that_does_not_answer_for_long_is_told(lines: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(check_planner, "broken_by", lambda *problem: time.sleep(0.3) or "")
    monkeypatch.setattr(check_planner, "SLOW_S", 0.1)
    told = CliRunner().invoke(app, ["check-planner", lines, "--problems", "1"])
    assert "problem 0: no answer for 0 s yet" in told.output, told.output


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


def install(part: str, group: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As if a package of the module's name were installed, which registers the part by that name."""
    name = part.partition(":")[0]
    told = folder / f"{name}-1.0.dist-info"
    told.mkdir()
    (told / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (told / "entry_points.txt").write_text(f"[{group}]\n{name} = {part}\n")
    monkeypatch.syspath_prepend(str(folder))


def test_a_package_may_register_a_planner(lines: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UnknownPlannerError):
        make_planner("lines", PlannerSettings())
    install(lines, "rover_companion.planners", tmp_path, monkeypatch)
    planner: Planner = make_planner("lines", PlannerSettings())
    assert planner.name == "lines"
    with pytest.raises(UnknownPlannerError, match=r"did you mean 'lines'"):
        make_planner("liness", PlannerSettings())


def test_a_package_may_register_a_controller(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dice = written("planners.md", "Dice", tmp_path, monkeypatch)
    with pytest.raises(ValidationError, match="unknown controller 'dice'"):
        Settings.model_validate({"guidance": {"controller": "dice"}})
    install(dice, "rover_companion.controllers", tmp_path, monkeypatch)
    assert Settings.model_validate({"guidance": {"controller": "dice"}}).guidance.controller == "dice"
    assert type(motion_planner("dice", 1)).__name__ == "Dice"


def test_a_package_may_register_a_world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    orchard = written("worlds.md", "Orchard", tmp_path, monkeypatch)
    make = ["world", "make", "orchard", "--out", "worlds", "--set", "row_m=3"]
    told = CliRunner().invoke(sitl, make)
    assert told.exit_code == 2 and "orchard" in told.output
    install(orchard, "rover_companion.worlds", tmp_path, monkeypatch)
    made = CliRunner().invoke(sitl, make)
    assert made.exit_code == 0, made.output
    assert GroundSpec.of("orchard row_m=3") is not None


def test_a_controller_that_fails_on_the_way_ends_the_drive_with_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dice = written("planners.md", "Dice", tmp_path, monkeypatch)
    source, plan = Path("dice.py").read_text(encoding="utf-8"), "def plan(self, problem, passed_s):\n"
    late = "Dice.calls = getattr(Dice, 'calls', 0) + 1\n        if Dice.calls > 20: raise ValueError('my bug')"
    Path("dice.py").write_text(source.replace(plan, f"{plan}        {late}\n"))
    Path("dice.toml").write_text(f'guidance.controller = "{dice}"\n')
    mission = str(MAPS.parent / "first-drive" / "gate.toml")
    driven = CliRunner().invoke(sitl, ["drive", mission, "--settings", "dice.toml"])
    assert isinstance(driven.exception, OwnPartError), driven.output
    assert re.fullmatch(
        r"controller 'dice:Dice' fails: ValueError: my bug \(dice.py, line \d+\)", str(driven.exception)
    )


@pytest.mark.thorough
def test_the_controller_of_the_page_drives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dice = written("planners.md", "Dice", tmp_path, monkeypatch)
    settings = tmp_path / "dice.toml"
    settings.write_text(f'guidance.controller = "{dice}"\n')
    mission = ["drive", str(MAPS.parent / "first-drive" / "gate.toml"), "--settings", str(settings)]
    driven = CliRunner().invoke(sitl, [*mission, "--record", "rec"])
    assert driven.exit_code == 0, driven.output
    replayed = CliRunner().invoke(app, ["replay", "rec"])
    assert replayed.exit_code == 0 and "differences: none" in replayed.output, replayed.output
    settings.write_text('guidance.controller = "dice:Nothing"\n')
    told = CliRunner().invoke(sitl, mission)
    assert told.exit_code == 2 and told.output.strip() == (
        f"{settings}: guidance.controller: controller 'dice:Nothing' cannot be loaded: AttributeError: "
        "module 'dice' has no attribute 'Nothing'"
    )
    source = Path("dice.py").read_text(encoding="utf-8")
    Path("half.py").write_text(source.replace("def forget", "def forgets"), encoding="utf-8")
    settings.write_text('guidance.controller = "half:Dice"\n')
    told = CliRunner().invoke(sitl, mission)
    assert told.exit_code == 2 and "controller 'half:Dice' has no forget" in told.output
    settings.write_text('guidance.controller = "motion-gb"\n')
    told = CliRunner().invoke(sitl, mission)
    assert told.exit_code == 2 and "unknown controller 'motion-gb', did you mean 'motion-ga'?" in told.output


def test_the_world_of_the_page_has_a_way_and_is_driven(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    orchard = written("worlds.md", "Orchard", tmp_path, monkeypatch)
    make = ["world", "make", orchard, "--out", "worlds"]
    made = CliRunner().invoke(sitl, [*make, "--set", "row_m=3", "--seed", "1"])
    assert made.exit_code == 0, made.output
    assert load_mission(tmp_path / "worlds" / "orchard-Orchard-1.toml").targets
    told = CliRunner().invoke(sitl, [*make, "--set", "row_m=1"])
    assert told.exit_code == 2 and "row_m" in told.output and len(told.output.strip().splitlines()) == 1
    told = CliRunner().invoke(sitl, ["world", "make", "orchard:np"])
    assert told.exit_code == 2 and "world 'orchard:np'" in told.output
    told = CliRunner().invoke(sitl, ["world", "make", "mase"])
    assert told.exit_code == 2 and "did you mean 'maze'?" in told.output
    ground = GroundSpec.of(f"{orchard} row_m=5 movers=1")
    assert ground is not None and (ground.kind, ground.given.model_dump()) == (orchard, {"row_m": 5.0})
    source = Path("orchard.py").read_text(encoding="utf-8")
    Path("orchard.py").write_text(source.replace("return solid", "return solid[1:]"), encoding="utf-8")
    monkeypatch.delitem(sys.modules, "orchard")
    with pytest.raises(OwnPartError, match="begin with empty"):
        ground_of(orchard, 1)
