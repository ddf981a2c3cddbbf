"""A companion that falls dead at any moment: the rover comes to stand by itself and touches nothing on its way."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from companion.mission.load import load_mission
from companion.mission.mission import Mission
from sitl.experiments import dead_companion
from sitl.experiments.dead_companion import DeadReport, Death, die, overheard, run, with_suite
from sitl.experiments.experiment import Options
from sitl.experiments.off_model import scenario_off_model, taken_for

MISSIONS = Path(__file__).resolve().parents[2] / "missions"


@pytest.mark.parametrize(
    ("name", "suite"),
    [
        pytest.param("clutter.toml", "lidar-90", marks=pytest.mark.thorough),
        pytest.param("complex.toml", "lidar-360", marks=pytest.mark.thorough),
        pytest.param("ackermann.toml", "lidar-360", marks=pytest.mark.thorough),
    ],
)
def test_whenever_it_dies_nothing_is_touched(name: str, suite: str) -> None:
    told = overheard(with_suite(load_mission(MISSIONS / name), suite), 0)
    moments_s = np.random.default_rng(0).uniform(told.begin_s, told.end_s, 6)
    deaths = die(told, moments_s.tolist())
    assert sum(death.speed_m_s > 0.1 for death in deaths) >= 2, "some while it drove"
    assert [death for death in deaths if death.touched] == []
    assert max(death.went_s for death in deaths) < 30.0
    assert max(death.went_m for death in deaths) < 9.0


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "seed", "timeout_s", "went_m"), [("rooms.toml", 10, 1.0, 6.0), ("complex.toml", 0, 10.0, 10.0)]
)
def test_with_another_timeout_of_the_autopilot_nothing_is_touched_either(
    name: str, seed: int, timeout_s: float, went_m: float
) -> None:
    """As long as the autopilot says what is told lasts. Without that, walls were touched in both drives."""
    mission = with_suite(load_mission(MISSIONS / name), "lidar-360")
    scenario = scenario_off_model(mission, seed, 0.3, guarded=False, timeout_s=timeout_s)
    told = overheard(mission, seed, taken_for("motion-ga", "test"), scenario)
    deaths = die(told, np.linspace(told.begin_s + 2.0, told.end_s - 2.0, 20).tolist())
    if timeout_s == 1.0:
        deaths += die(told, [49.69])
    assert [death for death in deaths if death.touched] == []
    assert max(death.went_m for death in deaths) < went_m


@pytest.mark.thorough
def test_what_is_heard_again_is_the_same_drive() -> None:
    told = overheard(with_suite(load_mission(MISSIONS / "one-obstacle.toml"), "lidar-360"), 3)
    late, early = die(told, [told.end_s + 1.0, told.begin_s - 1.0])
    assert late == die(told, [late.time_s])[0], "one death does not depend on those before it"
    assert (early.speed_m_s, early.went_m) == (0.0, 0.0)
    assert late.went_m < 0.5 and late.speed_m_s < 1.0, "at its end the rover stops"
    assert told.end_s - told.begin_s > 40.0


def test_the_table_counts_what_it_says() -> None:
    deaths = tuple(
        Death("Yard", "beams", "points", 0, 50.0, speed, touched, 1, 3.0, 5.0)
        for speed, touched in ((1.0, 2), (0.0, 0))
    )
    hit = replace(deaths[0], touched=1, with_what=("walker at 0.7 m/s",))
    told = "- Yard, `beams`, seed 0, dead after 50.0 s at 1.0 m/s: walker at 0.7 m/s, 3.0 m farther"
    assert told in DeadReport(Options(runs=1), (hit,)).section()
    report = DeadReport(Options(runs=2), deaths)
    (table,) = report.tables()
    assert [list(column.cells)[-1] for column in table.columns] == ["all", "", "2", "1", "2", "2", "1.0", "3.0", "5.0"]
    assert report.as_json()["deaths"] == [{name: getattr(death, name) for name in Death.__slots__} for death in deaths]


def test_chosen_missions_die_as_they_do_among_all(monkeypatch: pytest.MonkeyPatch) -> None:
    def one(mission: Mission, controller: str, *others: float) -> list[Death]:
        guarded, off, timeout_s, seed, count = others
        assert (guarded, off, timeout_s) == (False, 0.3, 3.0)
        suite = "" if mission.sitl is None else str(mission.sitl.sensors)
        return [Death(str(mission.source), suite, controller, int(seed), 0.0, 0.0, 0, 0, 0.0, float(count))]

    monkeypatch.setattr(dead_companion, "deaths_of", one)
    maps = MISSIONS / "maps"
    everything = run(Options(runs=60, maps=maps), lambda done, of: None).deaths
    chosen = run(Options(runs=60, maps=maps, missions=("field.plan", "depot")), lambda done, of: None).deaths
    assert chosen == tuple(one for one in everything if one.mission.endswith(("field.plan", "depot.toml")))
    assert len(everything) == 12 * 3 * 2 == len({death.seed for death in everything}) and len(chosen) == 2 * 3 * 2
