"""Gates: the worlds, a drive through one, and the table."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from companion.core.footprint import Footprint
from companion.mission.mission import Mission
from sitl.cli.commands import app
from sitl.experiments import gates
from sitl.experiments.experiment import Advance, Options
from sitl.experiments.gates import FINE_M, OUTLINE, SIDE_M, GateDrive, GatesReport, drive, widths_m, world_of
from sitl.scenario import Scenario


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 60.0])
@pytest.mark.parametrize("width_m", [0.8, 1.5])
def test_the_gap_is_as_wide_as_it_says(width_m: float, angle_deg: float) -> None:
    world, aside_m = world_of(width_m, angle_deg, 1.0), 1.0
    north_m, east_m = 0.5 * SIDE_M + aside_m, 0.5 * SIDE_M
    assert world.clearance_m(north_m, east_m, 2.0) == pytest.approx(0.5 * width_m, abs=FINE_M)
    turn_rad = math.radians(angle_deg)
    for beside_m in (0.5 * width_m + 0.1, 3.0):
        there = north_m + beside_m * math.cos(turn_rad), east_m + beside_m * math.sin(turn_rad)
        assert world.clearance_m(*there, 2.0) < FINE_M, "the wall goes on"


@pytest.mark.thorough
def test_a_rover_off_its_model_drives_through_a_gate_a_little_wider_than_it_is() -> None:
    """0.15 m on each side, less what a sector of 5 degrees makes of the ends of walls."""
    one = drive("motion-ga", 1.0, 60.0, 0)
    assert one.reached and one.contacts == 0 and one.seconds < 90.0


@pytest.mark.thorough
def test_a_long_rover_lines_up_before_a_gap_that_is_0_2_m_wider_than_it_is() -> None:
    """Of 16 such drives 13 came through; without the rules for long rovers 10 of 18, with limits that were known."""
    drives = [drive("motion-ga", 0.7, 30.0, seed, outline=Footprint.rectangle(1.5, 0.5)) for seed in (1, 2, 3)]
    assert sum(one.reached for one in drives) >= 2 and not any(one.contacts for one in drives), drives


def test_gates_are_as_much_wider_whatever_the_rover_is_and_the_command_names_it() -> None:
    options = Options(runs=1, outline_m=(2.0, 0.5))
    drives = tuple(GateDrive("motion-ga", width_m, 0.0, 0, True, 0, 9.0) for width_m in (0.6, 0.7, 0.8, 1.0, 1.3))
    report = GatesReport(options, drives)
    assert [row[2] for row in report._rows()] == ["1"] * 5
    assert "--outline 2x0.5" in report.section() and report.section_name == "gates-2x0.5"


def test_gates_are_driven_with_the_guard_or_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[bool, float]] = []

    def quick(*task: Any) -> GateDrive:
        asked.append(task[-2:])
        return GateDrive("motion-ga", 0.9, 0.0, 0, True, 0, 9.0)

    monkeypatch.setattr(gates, "drive", quick)
    for setups, guarded in (("guarded", True), ("strict", False)):
        report = gates.run(Options(runs=1, setups=(setups,)), lambda done, of: None)
        assert set(asked) == {(guarded, 3.0)} and ("no guard" in report.section()) is not guarded
        assert report.section_name == ("gates" if guarded else "gates-strict")
        asked.clear()
    report = gates.run(Options(runs=1, setups=("strict",), timeout_s=1.0), lambda done, of: None)
    assert set(asked) == {(False, 1.0)} and report.section_name == "gates-guid-timeout-1-strict"
    assert "--guid-timeout 1" in report.section() and "ends a velocity after 1 s" in report.section()
    for wrong in ("jackal", "guarded,strict"):
        refused = CliRunner().invoke(app, ["experiment", "gates", "--setups", wrong])
        assert refused.exit_code == 2 and f"--setups {wrong}: gates take guarded or strict" in refused.output


@pytest.mark.parametrize("given", ["2.0", "0.5x2.0", "axb", "9x1", "1x1x1", "nanx1"])
def test_an_outline_that_is_none_is_refused(given: str) -> None:
    result = CliRunner().invoke(app, ["experiment", "gates", "--outline", given])
    assert result.exit_code == 2 and "--outline" in result.output and "2.0x0.5" in result.output
    refused = CliRunner().invoke(app, ["experiment", "traffic", "--outline", "2x0.5"])
    assert refused.exit_code == 2 and "the option is for gates" in refused.output


def test_the_table_counts_by_width_and_angle() -> None:
    drives = tuple(GateDrive("motion-ga", width_m, 30.0, 0, width_m > 0.9, 0, 12.0) for width_m in widths_m(OUTLINE))
    rows = GatesReport(Options(runs=1), drives)._rows()
    assert [row[1] for row in rows] == ["0.8", "0.9", "1", "1.2", "1.5"]
    assert [row[3] for row in rows] == ["0", "0", "1", "1", "1"] and rows[0][-1] == "-"
    assert np.all([row[2] == row[4] == "0" for row in rows])


def test_without_a_terminal_progress_is_told_in_a_few_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    def quick(options: Options, advance: Advance) -> GatesReport:
        for done in range(1, 36):
            advance(done, 35)
        return GatesReport(options, ())

    monkeypatch.setattr(gates, "run", quick)
    result = CliRunner().invoke(app, ["experiment", "gates", "--runs", "1"])
    assert result.exit_code == 0
    lines = result.stderr.splitlines()
    assert len(lines) == 10 and lines[0] == "gates: 4 of 35" and lines[-1] == "gates: 35 of 35"


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 60.0])
def test_the_rover_meets_a_gate_that_is_turned_by_its_angle(monkeypatch: pytest.MonkeyPatch, angle_deg: float) -> None:
    class Asked(Exception):
        pass

    def asked(mission: Mission, scenario: Scenario, *others: object, **more: object) -> None:
        raise Asked(scenario.world)

    monkeypatch.setattr(gates, "Drive", asked)
    with pytest.raises(Asked) as seen:
        drive("motion-ga", 1.0, angle_deg, 0)
    (world,) = seen.value.args
    aside_m = float(np.random.default_rng((0, 53)).uniform(-gates.ASIDE_M, gates.ASIDE_M))
    assert np.array_equal(world.obstacles, world_of(1.0, angle_deg, aside_m).obstacles)


def test_every_gate_is_driven_through_at_every_angle(monkeypatch: pytest.MonkeyPatch) -> None:
    def quick(name: str, width_m: float, angle_deg: float, seed: int, *others: object) -> GateDrive:
        return GateDrive(name, width_m, angle_deg, seed, True, 0, 9.0)

    monkeypatch.setattr(gates, "drive", quick)
    drives = gates.run(Options(runs=2), lambda done, of: None).drives
    assert sorted((one.width_m, one.angle_deg, one.seed) for one in drives) == [
        (width_m, angle_deg, seed)
        for width_m in widths_m(OUTLINE)
        for angle_deg in (0.0, 30.0, 60.0)
        for seed in (0, 1)
    ]
