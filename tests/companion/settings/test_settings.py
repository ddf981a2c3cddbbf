import re
from pathlib import Path

import pytest
from pydantic import BaseModel

from companion.settings import Settings, SettingsError, load_settings, parse_settings


def refused(text: str, tmp_path: Path) -> str:
    file = tmp_path / "rover.toml"
    file.write_text(text)
    with pytest.raises(SettingsError) as error:
        load_settings(file)
    message = str(error.value)
    assert message.startswith(f"{file}: ") and "\n" not in message
    return message


def test_no_file_means_the_defaults():
    assert load_settings(None) == Settings() == parse_settings({}, "nothing")


@pytest.mark.parametrize(
    ("text", "place", "near"),
    [
        ("plannr = 1", "plannr", "planner"),
        ("[guidance]\nhorison_m = 5.0", "guidance.horison_m", "horizon_m"),
        ("[navigator.quick]\nmax_epoch = 5", "navigator.quick.max_epoch", "max_epochs"),
        ("[navigator.thorough]\ncontrol_point = [4]", "navigator.thorough.control_point", "control_points"),
        ("[link]\ntick_hertz = 5", "link.tick_hertz", "tick_hz"),
        ("[safty]\nstale_s = 1", "safty", "safety"),
    ],
)
def test_an_unknown_key_is_named_with_the_nearest_known_one(text, place, near, tmp_path):
    assert f"{place}: unknown key, did you mean '{near}'?" in refused(text, tmp_path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[mapping]\nevidence_m = 1e-9", "mapping.evidence_m"),
        ("[guidance]\nclearances = []", "guidance.clearances"),
        ("[guidance]\nclearances = [[-0.1, 1.0]]", "guidance.clearances"),
    ],
)
def test_what_would_hang_or_touch_something_is_refused(text, said, tmp_path):
    assert said in refused(text, tmp_path)


def test_a_key_like_no_other_is_not_taken_for_one_that_is_unrelated(tmp_path):
    message = refused("[navigator]\nreplan_evry = 1", tmp_path)
    assert "did you mean" not in message
    assert "navigator.replan_evry: unknown key; known here: planner, better_every_fields" in message


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("[planner]\nmixing = 0.5", "planner.mixing"),
        ("[planner]\nway_points = 'five'", "planner.way_points"),
        ("[navigator.quick]\npopulation = 3", "navigator.quick.population"),
        ("[navigator.thorough]\ncontrol_points = [4, 2]", "navigator.thorough.control_points.1"),
        ("[navigator.thorough]\ncontrol_points = []", "navigator.thorough.control_points"),
        ("[safety]\nstale_s = nan", "safety.stale_s"),
        ("[guidance]\nhorizon_m = inf", "guidance.horizon_m"),
        ("[link]\nsetpoint = 'teleport'", "link.setpoint"),
        ("profile = 'poster'", "profile"),
        ("mapping = 3", "mapping"),
        ("[guidance]\nhorizon_m = '6'", "guidance.horizon_m"),
        ("[guidance]\nmax_speed_m_s = true", "guidance.max_speed_m_s"),
        ("[link]\ncomponent_id = 1", "link.component_id"),
        ("[power]\nreturn_percent = 5\nhold_percent = 50", "power"),
    ],
)
def test_a_bad_value_is_named_with_its_place(text, place, tmp_path):
    assert f": {place}: " in refused(text, tmp_path)


def test_part_of_a_section_leaves_the_rest_at_its_defaults():
    settings = parse_settings({"navigator": {"thorough": {"max_epochs": 7}, "quick": {"population": 24}}}, "test")
    default = Settings().navigator
    assert settings.navigator.thorough == default.thorough.model_copy(update={"max_epochs": 7})
    assert settings.navigator.quick == default.quick.model_copy(update={"population": 24})


def test_the_papers_profile_means_the_genetic_algorithm_alone_unless_said_otherwise():
    assert Settings().navigator.planner == "hybrid"
    assert parse_settings({"profile": "paper"}, "test").navigator.planner == "bspline-ga"
    chosen = parse_settings({"profile": "paper", "navigator": {"planner": "dijkstra"}}, "test")
    assert chosen.navigator.planner == "dijkstra"


def test_planned_motions_have_a_fine_map_unless_said_otherwise() -> None:
    own = parse_settings({"guidance": {"controller": "dwa"}, "mapping": {"hit_depth_m": 0.03}}, "test")
    assert (own.mapping.hit_depth_m, own.mapping.evidence_m, own.mapping.keeps) == (0.03, 0.1, "outline")
    assert own.link.range_rate_hz == 20.0
    points = parse_settings({"guidance": {"controller": "points"}}, "test")
    assert (points.mapping, points.link) == (Settings().mapping, Settings().link)


def test_settings_cannot_be_changed():
    with pytest.raises(ValueError, match="frozen"):
        Settings().profile = "paper"


def test_every_setting_is_read_somewhere() -> None:
    root = Path(__file__).parents[3]
    files = [
        path for part in ("companion", "sitl") for path in (root / part).rglob("*.py") if path.name != "settings.py"
    ]
    text = "\n".join(path.read_text(encoding="utf-8") for path in files)
    settings = root / "companion" / "settings" / "settings.py"
    own = settings.read_text(encoding="utf-8")
    names = {(section, key) for section, part in Settings() if isinstance(part, BaseModel) for key, _ in part}
    words = set(re.findall(r"\w+", text))
    unread = {(s, key) for s, key in names if key not in words and f".{key}" not in own}
    assert len(names) > 50 and unread == set()


def test_a_whole_number_that_no_kernel_takes_is_refused() -> None:
    assert parse_settings({"navigator": {"quick": {"max_epochs": 2**31 - 1}}}, "s.toml")
    with pytest.raises(SettingsError, match=r"navigator\.quick: max_epochs should be at most 2147483647"):
        parse_settings({"navigator": {"quick": {"max_epochs": 2**31}}}, "s.toml")


@pytest.mark.parametrize("wrong", ["1.5", "1,5", " 2 "])
def test_a_number_in_quotes_is_refused_with_what_to_write(wrong: str) -> None:
    right = wrong.strip().replace(",", ".")
    with pytest.raises(SettingsError, match=rf"motion.turn_rad_s.*; write {right} without quotes$"):
        parse_settings({"motion": {"turn_rad_s": wrong}}, "test")
