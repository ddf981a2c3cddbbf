"""The documentation is true: examples work, commands, options, settings, modules and tests exist, links resolve."""

from __future__ import annotations

import configparser
import functools
import json
import re
import runpy
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path

import click
import pytest
import typer
from typer.testing import CliRunner

import companion.cli.commands
import sitl.cli.commands
from companion.cli.ending import EXIT_MISSED
from companion.cli.entry import EXIT_STOPPED
from companion.cli.inputs import EXIT_BAD_INPUT
from companion.cli.service import ALIVE_S
from companion.mission.sensor_tables import BeamTable, LidarTable, ProximityTable, SensorsTable, SunTable
from companion.settings import parse_settings
from sitl.campaign.campaign_file import load_campaign, run_count
from sitl.campaign.run_spec import specs_of
from sitl.faults.fault_file import load_faults
from sitl.faults.tables import KINDS
from sitl.search.genes import FAULTS
from sitl.sensors.suites import suite_of
from sitl.world.world_file import DoorTable, ObstacleTable, RoughTable, SlipperyTable, WorldTable, load_world

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    ROOT / "README.md",
    ROOT / "CHANGELOG.md",
    ROOT / "missions" / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
]
APPS = {"rover-companion": companion.cli.commands.app, "rover-sitl": sitl.cli.commands.app}
FORBIDDEN = re.compile(r"/work\b|/root\b|/tmp\b|/home/", re.IGNORECASE)

pages = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))


def blocks(language: str) -> list[tuple[str, str]]:
    """Every code block of a language on all pages: page and line, and its text."""
    pattern = re.compile(rf"^ *```{language}\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
    return [
        (f"{page.name} line {text.count(chr(10), 0, found.start()) + 1}", found[1])
        for page in PAGES
        for text in [page.read_text(encoding="utf-8")]
        for found in pattern.finditer(text)
    ]


README_EXAMPLE = {"yard-world.toml": "# world", "yard.toml": 'name = "Yard"\n\n[[target]]'}
"""The files of README's own mission, and how each begins."""


def write_readme_example(folder: Path) -> Path:
    """Writes README's own mission and its world; gives the mission."""
    texts = [text for where, text in blocks("toml") if where.startswith("README.md")]
    for name, beginning in README_EXAMPLE.items():
        (text,) = (text for text in texts if text.startswith(beginning))
        (folder / name).write_text(text, encoding="utf-8")
    return folder / "yard.toml"


def test_the_mission_in_the_readme_is_driven_as_shown(tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    drive = ["drive", str(write_readme_example(tmp_path)), "--json", str(report)]
    result = CliRunner().invoke(APPS["rover-sitl"], drive)
    assert result.exit_code == 0, result.output
    run = json.loads(report.read_text(encoding="utf-8"))
    assert run["collisions"] == 0 and [target["status"] for target in run["targets"]] == ["reached"]
    distance_m, driving_s, simulated_s = run["distance_m"], run["driving_time_s"], run["sim_time_s"]
    shown = (
        f"{distance_m:.1f} m in {driving_s:.0f} s ({distance_m / driving_s:.2f} m/s)",
        f"{run['steps']} fields, {run['return_steps']} of them going back, {run['searches']} searches",
        f"{simulated_s:.0f} s simulated",
    )
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert [text for text in shown if text not in readme] == [], "paste the new report into README.md"


@pytest.mark.parametrize(("where", "text"), blocks("toml"))
def test_toml_examples_are_understood(where: str, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if text.startswith("# settings"):
        assert parse_settings(tomllib.loads(text), where).profile
        return
    if text.startswith("# faults"):
        (tmp_path / "plan.toml").write_text(text, encoding="utf-8")
        assert load_faults(tmp_path / "plan.toml").faults
        return
    if text.startswith("# campaign"):
        shutil.copy(ROOT / "missions" / "dead-end.toml", tmp_path)
        (tmp_path / "campaigns").mkdir()
        (planner,) = (code for _, code in blocks("python") if "class Dogleg" in code)
        (tmp_path / "dogleg.py").write_text(planner, encoding="utf-8")
        monkeypatch.chdir(tmp_path)
        monkeypatch.delitem(sys.modules, "dogleg", raising=False)
        (tmp_path / "campaigns" / "c.toml").write_text(text, encoding="utf-8")
        assert run_count(load_campaign(tmp_path / "campaigns" / "c.toml")) > 1
        return
    if text.startswith("# world"):
        (tmp_path / "world.toml").write_text(text, encoding="utf-8")
        assert load_world(tmp_path / "world.toml").obstacles.any()
        return
    if text.startswith("# sensors"):
        assert suite_of(SensorsTable.model_validate(tomllib.loads(text))).lidar
        return
    shutil.copytree(ROOT / "missions" / "maps", tmp_path / "maps")
    shutil.copy(ROOT / "missions" / "field.plan", tmp_path)
    (tmp_path / "rover.param").write_text("WP_SPEED,2\n", encoding="utf-8")
    write_readme_example(tmp_path)
    mission = tmp_path / "example.toml"
    mission.write_text(text, encoding="utf-8")
    result = CliRunner().invoke(APPS["rover-companion"], ["mission", "check", str(mission)])
    assert result.exit_code == 0, f"{where}: {result.stderr}"


def test_every_key_of_a_mission_is_explained() -> None:
    from companion.mission.toml_reader import (
        AreaTable,
        CorridorTable,
        GridTable,
        MissionTable,
        RoverTable,
        SitlTable,
        TargetTable,
    )

    text = (ROOT / "docs" / "missions.md").read_text(encoding="utf-8")
    tables = (MissionTable, GridTable, RoverTable, TargetTable, AreaTable, CorridorTable, SitlTable)
    for key in {key for table in tables for key in table.model_fields}:
        stem = "line_..." if key.startswith("line_") else key
        assert key in text or stem in text, f"docs/missions.md does not mention {key}"


def test_every_key_of_a_world_and_of_sensors_is_explained() -> None:
    text = (ROOT / "docs" / "worlds.md").read_text(encoding="utf-8")
    tables = [WorldTable, ObstacleTable, DoorTable, SlipperyTable, RoughTable]
    tables += [SensorsTable, LidarTable, BeamTable, ProximityTable, SunTable]
    for key in {key for table in tables for key in table.model_fields}:
        assert re.search(rf"\b{key}\b", text), f"docs/worlds.md does not mention {key}"


def usages(page: Path) -> list[list[str]]:
    """The words of every use of one of our commands with a sub-command, in shell blocks or inline code."""
    text = page.read_text(encoding="utf-8")
    blocks = re.findall(r"^ *```sh\n(.*?)^ *```", text, re.MULTILINE | re.DOTALL)
    found = []
    for piece in (*re.findall(r"`([^`\n]+)`", text), *(line for block in blocks for line in block.splitlines())):
        words = piece.split("#")[0].split()
        words[:1] = [word.rpartition("/")[2] for word in words[:1]]
        if len(words) > 1 and words[0] in APPS and re.fullmatch("[a-z][a-z-]*", words[1]):
            found.append(words)
    return found


@functools.cache
def app_of(name: str) -> click.Command:
    return typer.main.get_command(APPS[name])


def command_of(words: list[str]) -> tuple[click.Command, list[str]]:
    """The command that the words name, and the remaining words. KeyError: there is no such command."""
    command, rest = app_of(words[0]), words[1:]
    while rest and isinstance(getattr(command, "commands", None), Mapping):
        command = command.commands[rest.pop(0)]  # type: ignore[attr-defined]
    return command, rest


def test_there_are_usages_to_check() -> None:
    found = [words for page in PAGES for words in usages(page)]
    assert len(found) > 100
    assert {words[1] for words in found} >= {"run", "plan", "mission", "drive", "serve", "experiment"}


def wrong_in(words: list[str]) -> str:
    """What is wrong with a usage; empty: nothing."""
    try:
        command, rest = command_of(words)
    except KeyError:
        return f"no such command: {' '.join(words)}"
    options = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
    asked = {word.strip("[]").rstrip(".,;") for word in rest if word.strip("[]").startswith("--")}
    unknown = asked - options - {"--help"}
    return f"no such option: {', '.join(unknown)}: {' '.join(words)}" if unknown else ""


@pages
def test_commands_and_options_exist(page: Path) -> None:
    assert not [wrong for words in usages(page) if (wrong := wrong_in(words))]


def test_a_usage_that_is_wrong_is_found() -> None:
    assert wrong_in(["rover-sitl", "drove"]) and wrong_in(["rover-sitl", "drive", "--fast"])


def test_every_command_is_in_the_readme() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for name in APPS:
        for sub in app_of(name).commands:  # type: ignore[attr-defined]
            assert f"{name} {sub}" in text


@pages
def test_options_named_alone_exist_somewhere(page: Path) -> None:
    known = {"--help"}
    queue = [app_of(name) for name in APPS]
    while queue:
        command = queue.pop()
        known |= {option for parameter in command.params for option in parameter.opts}
        queue += list(getattr(command, "commands", {}).values())
    named = set(re.findall(r"`(--[a-z0-9-]+)", page.read_text(encoding="utf-8")))
    assert named <= known


def test_the_settings_page_is_that_of_the_models() -> None:
    made = runpy.run_path(str(ROOT / "docs" / "make_settings.py"))["page"]()
    page = (ROOT / "docs" / "settings.md").read_text(encoding="utf-8")
    assert page == made, "run .venv/bin/python docs/make_settings.py"
    assert re.search(r"\| \| *$|\|  \|$", page, re.MULTILINE) is None, "a setting has no description"


@pages
def test_settings_that_pages_name_exist(page: Path) -> None:
    from companion.settings import Settings

    known = set()
    for name, field in Settings.model_fields.items():
        inner = getattr(field.annotation, "model_fields", {})
        known |= {f"{name}.{key}" for key in inner}
    sections = "|".join(Settings.model_fields)
    named = set(re.findall(rf"`((?:{sections})\.[a-z_0-9]+)`", page.read_text(encoding="utf-8")))
    assert {name for name in named if not name.endswith((".py", ".tlog"))} <= known


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading).lower().replace(" ", "-") for heading in headings}


@pages
def test_relative_links_lead_to_pages_and_headings(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for link in re.findall(r"\]\(([^)]+)\)", text):
        if "://" in link:
            continue
        path, _, anchor = link.partition("#")
        target = page.parent / path if path else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


@pages
def test_no_page_names_a_folder_of_the_machine_it_was_written_on(page: Path) -> None:
    found = FORBIDDEN.search(page.read_text(encoding="utf-8"))
    assert found is None, found


def test_every_page_can_be_reached_from_the_readme() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for page in (ROOT / "docs").glob("*.md"):
        assert f"(docs/{page.name})" in text


def test_modules_and_tests_that_pages_name_exist() -> None:
    tests = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for name in re.findall(r"`((?:companion|sitl|tests|docs|missions)/[a-z_/0-9.-]*)`", text):
            assert (ROOT / name).exists() or (ROOT / f"{name}.png").exists(), f"{page.name}: {name}"
        for name in re.findall(r"`(test_[a-z_0-9]+)`", text):
            assert f"def {name}(" in tests, f"{page.name}: {name}"


def test_every_table_of_hazards_has_its_five_columns_and_names_a_test() -> None:
    text = (ROOT / "docs" / "safety.md").read_text(encoding="utf-8")
    text = re.sub(r"<!-- begin .*?<!-- end [^\n]*\n", "", text, flags=re.DOTALL)  # tables that experiments write
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
    heads = [row for row in rows if row[0] == "hazard"]
    assert heads and all(row == ["hazard", "detection", "reaction", "time to reaction", "test"] for row in heads)
    hazards = [row for row in rows if row not in heads and set(row[0]) != {"-"}]
    for row in hazards:
        assert len(row) == 5 and all(row[i] for i in (0, 2, 3)), row[0]
        assert re.search(r"`(test_|tests/)", row[4]), f"{row[0]}: no test"


@pytest.mark.parametrize("name", ["rooms", "live-page", "report"])
def test_the_pictures_of_the_readme_are_small(name: str) -> None:
    file = ROOT / "docs" / "images" / f"{name}.png"
    assert 10_000 < file.stat().st_size < 200_000 and file.name in (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_service_is_one_that_systemd_takes_and_the_program_understands(tmp_path: Path) -> None:
    (_, text), *more = blocks("ini")
    assert not more
    unit = configparser.ConfigParser(strict=True)
    unit.optionxform = str  # type: ignore[assignment,method-assign]
    unit.read_string(text)
    service = unit["Service"]
    program, command, _, *options = service["ExecStart"].split()
    assert program.endswith("/bin/rover-companion")
    commands = app_of("rover-companion").commands  # type: ignore[attr-defined]
    known = {name for parameter in commands[command].params for name in parameter.opts}
    assert {option for option in options if option.startswith("--")} <= known
    assert service["RestartPreventExitStatus"].split() == [str(EXIT_BAD_INPUT), str(EXIT_MISSED)]
    assert service["SuccessExitStatus"] == str(EXIT_STOPPED)
    assert float(service["WatchdogSec"]) > 5 * ALIVE_S and float(service["TimeoutStopSec"]) > 2.0
    analyze = shutil.which("systemd-analyze")
    if analyze is not None:
        path = tmp_path / "rover-companion.service"
        path.write_text(text.replace(program, "/bin/true"))
        done = subprocess.run([analyze, "verify", path], capture_output=True, text=True, timeout=60, check=False)
        assert str(path) not in done.stderr and "rover-companion.service:" not in done.stderr, done.stderr


def test_the_run_that_the_page_on_campaigns_drives_again_exists() -> None:
    text = (ROOT / "docs" / "campaigns.md").read_text("utf-8")
    ((file, run_id),) = re.findall(r"rover-sitl campaign (\S+) --replay (\w+)", text)
    assert run_id in {spec.id for spec in specs_of(load_campaign(ROOT / file))}


def test_the_faults_that_a_search_moves_are_those_of_the_page() -> None:
    text = (ROOT / "docs" / "campaigns.md").read_text("utf-8").partition("Of faults:")[2]
    table, _, after = text.partition("A kind happens")
    assert {*re.findall(r"`(\w+)`", table)} == {*FAULTS}
    others = len(KINDS) - len(FAULTS)
    assert f"{others} kinds are not moved" in after.replace("Seven", "7")


GENERATED_PAGES = {"results.md", "benchmarks.md"}


@pages
def test_no_line_is_longer_than_the_limit(page: Path) -> None:
    """As in the code. Exempt: tables, code, and what a command writes (whole pages, or between begin and end)."""
    if page.name in GENERATED_PAGES:
        pytest.skip("a command writes it")
    limit = int(tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["ruff"]["line-length"])
    exempt = re.compile(r"<!-- begin ([\w-]+) -->.*?<!-- end \1 -->|^```.*?^```", re.M | re.S)
    text = exempt.sub("", page.read_text("utf-8"))
    assert [line for line in text.splitlines() if len(line) > limit and not line.startswith("|")] == []
