"""The soak: its ground can be driven, its faults end, its person helps only when asked, and its counts are right."""

from pathlib import Path

import numpy as np
import pytest

from companion.core.grid import OBSTACLE, inflated
from companion.mission.check import check_mission
from sitl.experiments import soak, soak_faults
from sitl.experiments.experiment import Options
from sitl.experiments.soak import Ended, Soaked, SoakReport, soaked
from sitl.experiments.soak_worlds import FINE_M, ROOM_M, drawn, mission_on


@pytest.mark.parametrize("seed", range(20))
def test_every_place_but_the_sealed_one_can_be_reached_with_room_to_spare(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ground = drawn(rng)
    mission = mission_on(ground, "lidar-90", "soak", rng)
    check_mission(mission)
    solid = ground.world.obstacles
    roomy = inflated(np.where(solid, OBSTACLE, 0.0), ROOM_M / FINE_M) < OBSTACLE
    from_start = reached_from(roomy, ground.start_m)
    assert all(from_start[index(place)] for place in ground.reachable_m)
    assert len(mission.targets) == len(ground.reachable_m) + (ground.sealed_m is not None)
    if ground.sealed_m is not None:
        assert not reached_from(~solid, ground.start_m)[index(ground.sealed_m)]


def index(place_m: tuple[float, float]) -> tuple[int, int]:
    return int(place_m[0] / FINE_M), int(place_m[1] / FINE_M)


def reached_from(free: np.ndarray, place_m: tuple[float, float]) -> np.ndarray:
    """A plain search, field by field."""
    reached = np.zeros_like(free)
    waiting = [index(place_m)]
    while waiting:
        row, column = waiting.pop()
        if free[row, column] and not reached[row, column]:
            reached[row, column] = True
            waiting += [(row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)]
    return reached


def test_faults_are_of_every_kind_and_come_while_it_drives() -> None:
    plans = [soak_faults.plan_of(np.random.default_rng(seed)) for seed in range(200)]
    faults = [fault for plan in plans for fault in plan.faults]
    assert {len(plan.faults) for plan in plans} == set(range(soak_faults.MOST + 1))
    kinds = {(type(fault), getattr(fault, "effect", None), getattr(fault, "defect", None)) for fault in faults}
    assert len(kinds) == len(soak_faults.FAULTS)
    assert all(fault.since == "driving" and fault.end_s > fault.start_s for fault in faults)
    assert plans[7] == soak_faults.plan_of(np.random.default_rng(7))


@pytest.mark.thorough
def test_a_run_is_driven() -> None:
    first = soaked(0)
    assert (first.ended, first.collisions, first.error) == (Ended.REACHED, 0, "")
    assert first.driven_m > 20.0


@pytest.mark.thorough
def test_a_run_repeats() -> None:
    first, again = soaked(0), soaked(0)
    assert (first.driven_m, first.time_s, first.person) == (again.driven_m, again.time_s, again.person)


def test_an_error_is_a_finding_and_not_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(soak, "_driven", lambda drive, result: 1 / 0)
    assert soaked(1).error.startswith("ZeroDivisionError")


def test_the_page_shows_what_was_counted(tmp_path: Path) -> None:
    runs = [Soaked(seed, "posts", "lidar-90", ("Reboot",), Ended.REACHED, memory_mb=300.0 + seed) for seed in range(39)]
    runs.append(Soaked(39, "rooms", "lidar-90", collisions=2, error="ValueError: x", memory_mb=340.0))
    report = SoakReport(Options(40), tuple(runs))
    assert report.growth_mb == pytest.approx(20.0, abs=1.0)
    (page,) = report.write_docs(tmp_path)
    text = page.read_text(encoding="utf-8")
    assert page.name == "safety.md" and "Reboot 39" in text
    assert "| all | 40 | 39 | 39 | 0 | 1 | 2 | 1 | 0 | 0 |" in text
    assert len(report.tables()) == 2
    assert report.failure == "1 runs with a contact, 1 runs with an error, 1 runs left unfinished"
    assert SoakReport(Options(39), tuple(runs[:39])).failure == ""
    assert SoakReport(Options(2), tuple(runs[:2])).growth_mb is None
