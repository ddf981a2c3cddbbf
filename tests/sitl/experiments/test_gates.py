"""Gates: the worlds, a drive through one, and the table."""

from __future__ import annotations

import math

import numpy as np
import pytest
from typer.testing import CliRunner

from sitl.cli.commands import app
from sitl.experiments import gates
from sitl.experiments.experiment import Advance, Options
from sitl.experiments.gates import FINE_M, SIDE_M, WIDTHS_M, GateDrive, GatesReport, drive, world_of


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


def test_the_table_counts_by_width_and_angle() -> None:
    drives = tuple(GateDrive("motion-ga", width_m, 30.0, 0, width_m > 0.9, 0, 12.0) for width_m in WIDTHS_M)
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
