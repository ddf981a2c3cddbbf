"""The depot: doors, ice, gravel, a forklift, and surfaces that no lidar sees; driven in lock-step."""

from pathlib import Path

import pytest

from companion.mission.load import load_mission
from companion.recording.recorder import NullRecorder
from companion.settings import Settings
from sitl.experiments.off_model import scenario_off_model
from sitl.lockstep import Drive
from sitl.scenario import scenario_from_mission, with_sensors
from sitl.view.picture import save_picture
from sitl.world.world import TOP_SPEED_M_S, ground_under
from tests.support.quick import first_of

MISSIONS = Path(__file__).resolve().parents[2] / "missions"


def driven(path: Path, sensors: str, seed: int = 0, limit_s: float = 300.0) -> Drive:
    mission = with_sensors(load_mission(path), sensors)
    run = Drive(mission, scenario_from_mission(mission), Settings(), seed, NullRecorder(), limit_s)
    run.run()
    return run


@pytest.mark.parametrize(
    "sensors",
    [
        pytest.param(suite, marks=pytest.mark.thorough)
        for suite in ("lidar-90", "lidar-360", str(MISSIONS / "sensors" / "weathered.toml"))
    ],
)
def test_the_depot_is_driven_without_a_collision(sensors: str, tmp_path: Path) -> None:
    run = driven(MISSIONS / "depot.toml", sensors)
    assert run.report.exit_code == 0, run.report.said
    world = run.simulator.world
    ground = [
        ground_under(world.ground, world.layers().solid, point.north_m, point.east_m) for point in run.report.track
    ]
    assert min(grip for grip, _ in ground) < 0.2, "the way leads over the ice"
    slow = {i for i, (_, pace) in enumerate(ground) if pace < 1.0}
    track = run.report.track
    for i in slow & {number + 1 for number in slow}:  # both ends of the piece on gravel
        moved_m = ((track[i].north_m - track[i - 1].north_m) ** 2 + (track[i].east_m - track[i - 1].east_m) ** 2) ** 0.5
        span_s = track[i].time_s - track[i - 1].time_s
        assert moved_m / span_s < 1.5, f"gravel slows the rover from {TOP_SPEED_M_S / 2} to 0.8 m/s"
    save_picture(run, tmp_path / "depot.png")
    assert (tmp_path / "depot.png").stat().st_size > 20_000


@pytest.mark.thorough
@pytest.mark.parametrize(("sensors", "seed"), [("lidar-360", 2), ("lidar-90", 5), ("lidar-90", 7)])
def test_what_lies_or_crosses_behind_gravel_is_not_touched(sensors: str, seed: int) -> None:
    """With a rover off its model: a forklift, and a wall.

    What it did on the gravel made its brakes seem better than they are, and its throttle was wide open.
    """
    mission = with_sensors(load_mission(MISSIONS / "depot.toml"), sensors)
    scenario = scenario_off_model(mission, seed, 0.3, guarded=True)
    motions = Settings.model_validate({"guidance": {"controller": "motion-ga"}})
    run = Drive(mission, scenario, motions, seed, NullRecorder(), 600.0)
    run.run()
    assert run.report.exit_code == 0, run.report.said
    assert run.simulator.collisions == ()


@first_of(
    1, ("material", "collisions"), [("solid", 0), ("glass", 1), pytest.param("black", 1, marks=pytest.mark.thorough)]
)
def test_what_sends_no_ray_back_is_not_seen_until_it_is_touched(material: str, collisions: int, tmp_path: Path) -> None:
    (tmp_path / "world.toml").write_text(
        "size_m = [20.0, 15.0]\n[[obstacle]]\nline_m = [[5.0, 10.0], [10.0, 10.0]]\nwidth_m = 0.2\n"
        f'material = "{material}"\n'
    )
    (tmp_path / "mission.toml").write_text(
        "[grid]\nresolution_m = 0.5\nsize = [40, 30]\nhome = [6, 15]\n[[target]]\nfield = [34, 15]\n"
        '[sitl]\nworld = "world.toml"\n'
    )
    run = driven(tmp_path / "mission.toml", "lidar-360", limit_s=70.0)
    assert min(len(run.simulator.collisions), 1) == collisions
    if collisions:
        first = run.simulator.collisions[0]
        assert first.east_m == pytest.approx(10.0 - 0.1 - 0.35, abs=0.12)
    else:
        assert run.report.exit_code == 0


@pytest.mark.thorough
def test_the_seed_decides_what_doors_ice_and_flaws_come_to() -> None:
    weathered = str(MISSIONS / "sensors" / "weathered.toml")
    tracks = [driven(MISSIONS / "depot.toml", weathered, seed, limit_s=75.0).report.track for seed in (1, 1, 2)]
    assert tracks[0] == tracks[1] != tracks[2]
