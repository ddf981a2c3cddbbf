"""Campaign files: what is read, and what is refused in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from sitl.campaign.campaign_file import CampaignError, load_campaign, run_count
from sitl.campaign.run_spec import specs_of

MISSIONS = Path(__file__).resolve().parents[3] / "missions"


def written(folder: Path, text: str) -> Path:
    file = folder / "c.toml"
    file.write_text(text)
    return file


def test_each_combination_is_one_run_for_each_seed_and_seeds_come_one_after_the_other(tmp_path: Path) -> None:
    table = load_campaign(
        written(
            tmp_path,
            'worlds = ["clutter", "yard"]\nseed = 5\nruns = 3\ncontrollers = ["points", "motion-ga"]\n'
            "guard = [false, true]\n[settings.shipped]\n[settings.wide]\nguidance = { clearance_m = 0.4 }\n",
        )
    )
    specs = list(specs_of(table))
    assert table.name == "c" and len(specs) == run_count(table) == 3 * 16
    assert len({spec.id for spec in specs}) == len(specs)
    assert [spec.seed for spec in specs] == sorted(spec.seed for spec in specs)
    wide = next(spec for spec in specs if spec.settings == "wide")
    assert wide.changes == '{"guidance": {"clearance_m": 0.4}}'


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "worlds: is missing"),
        ("worlds = []", "worlds: must have 1 or more values"),
        ('worlds = ["moon"]', "worlds: 'moon' is no kind of ground (clutter, rooms, yard"),
        ('worlds = ["yard"]\nrun = 3', "unknown key, did you mean 'runs'?"),
        ('worlds = ["yard"]\nruns = 0', "runs: must be 1 or more"),
        ('worlds = ["yard"]\nplanners = ["dijkstr"]', "planners 1: unknown planner 'dijkstr'"),
        ('worlds = ["yard"]\ncontrollers = ["feet"]', "controllers"),
        ('worlds = ["yard", "yard"]', "worlds: a value stands there twice"),
        ('worlds = ["rooms movers=0", "rooms  "]', "worlds: a value stands there twice"),
        (
            'worlds = ["yard"]\n[settings.a.guidance]\nclearance_m = 0.2\n[settings.b.guidance]\nclearance_m = 0.2',
            "settings: a value stands there twice",
        ),
        ('worlds = ["c.toml", "./c.toml"]', "worlds: a value stands there twice"),
        ('worlds = ["yard"]\nsensors = ["beams", " beams"]', "sensors: a value stands there twice"),
        (
            'worlds = ["yard"]\nfaults = ["gps_loss start_s=1 duration_s=2", "gps_loss duration_s=2.0 start_s=1"]',
            "faults: a value stands there twice",
        ),
        ('name = ".."\nworlds = ["yard"]', "name: '..' names no folder"),
        ('name = " "\nworlds = ["yard"]', "name: ' ' names no folder"),
        (f'worlds = ["yard"]\nseed = {2**64}', "seed: must be 9007199254740992 or less"),
        (
            'worlds = ["yard"]\n[search]\nsettings = { "guidance.look_ahead_m" = [-5.0, -1.0] }',
            "search.settings: guidance.look_ahead_m: must be more than 0 (got -5)",
        ),
        (
            'worlds = ["yard"]\n[search]\nsettings = { "guidance.look_ahead_m" = [1.0, inf] }',
            "search.settings: guidance.look_ahead_m: must be a finite number (got inf)",
        ),
        ('worlds = ["yard"]\n[search]\nparts = ["rover", "rover"]', "search.parts: one stands there twice"),
        (
            'worlds = ["yard"]\n[search]\nparts = ["rover"]\nsettings = { "guidance.look_ahead_m" = [1.0, 2.0] }',
            'search.settings: moved only where "settings" stands in search.parts',
        ),
        (
            'worlds = ["yard"]\n[search]\nparts = ["rover"]\nfaults_until_s = 20.0',
            'search.faults_until_s: means something only where "faults" stands in search.parts',
        ),
        (
            'worlds = ["yard"]\n[search]\nsettings = { "navigator.doubts" = [1, inf] }',
            "search.settings: navigator.doubts: must be a",
        ),
        ('worlds = ["yard"]\nfaults = ["no.toml"]', "no.toml: cannot be read"),
        ('worlds = ["yard"]\nsensors = ["lidr"]', "sensors 1: unknown sensors 'lidr'"),
        (
            'worlds = ["yard"]\nsensors = ["lidar-360", "none"]',
            "sensors 2: 'none': the companion does not drive without range data; name a suite or a file",
        ),
        ('worlds = ["yard"]\nsensors = ["no.toml"]', "no.toml: cannot be read"),
        ('name = "../x"\nworlds = ["yard"]', "name: it names a folder; use letters, digits"),
        ('worlds = ["yard"]\nplanners = ["collections:OrderedDict"]', "has no plan; docs/planners.md shows one"),
        ('worlds = ["yard"]\noff_model = [1.5]', "off_model"),
        ('worlds = ["yard"]\ntime_limit_s = 1.0', "time_limit_s: 1 s end every run before its rover sets off"),
        ('worlds = ["yard"]\ntime_limit_s = 45.0', "give more than 45, enough to drive, or leave it out"),
        ('worlds = ["yard"]\nruns = 2000000', "2000000 runs are more than 1000000"),
        ('worlds = ["yard"]\n[settings.a]\nguidance = { clear_m = 1.0 }', "settings.a: guidance.clear_m: unknown key"),
        (
            'worlds = ["yard"]\n[settings.a]\nguidance = { controller = "dwa" }',
            "stands in the list controllers; name it there",
        ),
    ],
)
def test_what_cannot_be_driven_is_one_line_with_file_place_and_remedy(tmp_path: Path, text: str, says: str) -> None:
    file = written(tmp_path, text)
    with pytest.raises(CampaignError) as caught:
        load_campaign(file)
    assert says in str(caught.value) and str(caught.value).startswith(f"{tmp_path}") and "\n" not in str(caught.value)


def test_files_count_from_the_campaigns_own_folder(tmp_path: Path) -> None:
    (tmp_path / "yard.toml").write_text("[[target]]\nnorth_m = 1.0\neast_m = 2.0\n")
    assert load_campaign(written(tmp_path, 'worlds = ["yard.toml"]')).worlds == ["yard.toml"]
