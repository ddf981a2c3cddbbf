"""Settings as MAVLink parameters: the table, bounds, the file, and the conversation about them."""

from __future__ import annotations

import contextlib
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.mavlink.codec import Codec
from companion.operator.parameter_server import ANSWER_S, MOST_OPEN, ParameterServer
from companion.settings import Settings, SettingsError, load_settings
from companion.settings.live_settings import LiveSettings
from companion.settings.tunable_parameters import (
    BY_NAME,
    TABLE,
    RefusedError,
    as_toml,
    changed,
    differences,
    with_tuned,
)
from companion.vehicle.commands import ParameterValue
from companion.vehicle.events import ParameterAsked, ParameterChangeAsked, ParametersAsked
from companion.vehicle.state import VehicleState
from tests.support.mavlink_vehicle import Station
from tests.support.notices import Notices

HORIZON = BY_NAME["CMP_HORIZON"]


class Ground:
    """A server with a list of what it says and keeps, and a clock."""

    def __init__(self) -> None:
        self.notices = Notices()
        self.settings = LiveSettings(Settings())
        self.kept: list[Settings] = []
        self.server = ParameterServer(self.settings, self.notices, self.kept.append)
        self.now_s = 100.0

    def ask(self, *events: object, ticks: int = 1) -> list[ParameterValue]:
        for event in events:
            self.server.take(event, VehicleState())
        answers = []
        for _ in range(ticks):
            self.now_s += 0.05
            answers += self.server.due(self.now_s)
        assert all(isinstance(answer, ParameterValue) for answer in answers)
        return answers  # type: ignore[return-value]

    def set(self, name: str, value: float, *, to_us: bool = True) -> list[ParameterValue]:
        self.now_s += 1.0
        return self.ask(ParameterChangeAsked(self.now_s, name, value, to_us), ticks=3)


def test_every_parameter_is_a_setting_whose_default_lies_within_its_bounds() -> None:
    assert len(BY_NAME) == len(TABLE)
    slow = Settings.model_validate({"guidance": {"min_speed_m_s": 0.05}})
    for parameter in TABLE:
        assert len(parameter.name) <= 16, "the longest name of a MAVLink parameter"
        assert parameter.name.startswith("CMP_")
        assert parameter.low <= parameter.value(Settings()) <= parameter.high, parameter.name
        for bound in (parameter.low, parameter.high):  # the settings themselves take what is in the table
            assert parameter.value(changed(slow, parameter, bound)) == bound
        assert isinstance(getattr(getattr(Settings(), parameter.section), parameter.key), int) == parameter.whole


@pytest.mark.parametrize("value", [1.99, 30.1, -1.0, 1e30, math.nan, math.inf, -math.inf])
def test_values_out_of_bounds_are_refused(value: float) -> None:
    with pytest.raises(RefusedError):
        changed(Settings(), HORIZON, value)


def test_a_number_that_travelled_as_32_bits_is_the_one_that_was_typed() -> None:
    value = mavlink.MAVLink_param_set_message(1, 191, b"CMP_ARRIVAL", 0.15, 9)
    received = mavlink.MAVLink(None).decode(bytearray(value.pack(mavlink.MAVLink(None, 255, 190)))).param_value
    assert received != 0.15
    assert changed(Settings(), BY_NAME["CMP_ARRIVAL"], received).guidance.arrival_m == 0.15


def test_the_slowest_speed_never_lies_above_the_fastest() -> None:
    slowest, fastest = BY_NAME["CMP_SPD_MIN"], BY_NAME["CMP_SPD_MAX"]
    with pytest.raises(RefusedError, match=r"^0\.1 below CMP_SPD_MIN 0\.5$"):
        changed(Settings(), fastest, 0.1)
    both = changed(changed(Settings(), slowest, 0.1), fastest, 0.2)
    with pytest.raises(RefusedError, match=r"^0\.3 above CMP_SPD_MAX 0\.2$"):
        changed(both, slowest, 0.3)
    assert slowest.value(changed(both, slowest, 0.2)) == 0.2


@given(st.lists(st.tuples(st.sampled_from(TABLE), st.floats(0.0, 1.0)), max_size=12))
def test_however_it_is_tuned_a_rover_that_creeps_stops_within_what_was_measured(choices: list[Any]) -> None:
    """ArduRover brakes with some 1 m/s2, 0.25 s after it is told."""
    tuned = Settings()
    for parameter, share in choices:
        value = parameter.low + share * (parameter.high - parameter.low)
        with contextlib.suppress(RefusedError):
            tuned = changed(tuned, parameter, round(value) if parameter.whole else value)
    guidance = tuned.guidance
    assert guidance.min_speed_m_s <= min(0.5, guidance.max_speed_m_s)
    assert guidance.deceleration_m_s2 <= 1.5 and guidance.brake_delay_s >= 0.2


CROSSED = "[guidance]\nmin_speed_m_s = 2.0\nmax_speed_m_s = 0.1\n"
ABOVE = "guidance: min_speed_m_s 2 lies above max_speed_m_s 0.1; lower the one or raise the other"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (CROSSED, ABOVE),
        ("[guidance]\nmin_speed_m_s = 0.6\n", "guidance.min_speed_m_s: 0.6 not in 0.05..0.5 (CMP_SPD_MIN)"),
        ("[safety]\nstale_s = 50\n", "safety.stale_s: 50 not in 0.3..3 (CMP_STALE)"),
        ("[navigator]\nbetter_every_fields = 101\n", "navigator.better_every_fields: 101 not in 1..100 (CMP_BETTER)"),
    ],
)
def test_what_no_ground_station_could_have_set_is_refused_when_it_is_read(
    tmp_path: Path, text: str, reason: str
) -> None:
    path = tmp_path / "tuned.toml"
    path.write_text(text)
    with pytest.raises(SettingsError) as caught:
        with_tuned(Settings(), path)
    remedy = "put it right, or delete it to go back to the settings file"
    assert str(caught.value) == f"{path}: {reason}; {remedy}"


def test_a_settings_file_may_say_more_but_not_a_slowest_speed_above_the_fastest(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    path.write_text(CROSSED)
    with pytest.raises(SettingsError) as caught:
        load_settings(path)
    assert str(caught.value) == f"{path}: {ABOVE}"
    path.write_text("[guidance]\nmin_speed_m_s = 0.6\n[safety]\nstale_s = 50\n")
    base = load_settings(path)
    assert with_tuned(base, tmp_path / "none") == base
    (tmp_path / "tuned.toml").write_text("[guidance]\nmax_speed_m_s = 0.5\n")
    with pytest.raises(SettingsError, match=r"min_speed_m_s 0\.6 lies above max_speed_m_s 0\.5"):
        with_tuned(base, tmp_path / "tuned.toml")


def test_half_a_doubt_is_refused() -> None:
    with pytest.raises(RefusedError, match="whole"):
        changed(Settings(), BY_NAME["CMP_DOUBTS"], 2.5)


@given(st.lists(st.tuples(st.sampled_from(TABLE), st.floats(0.0, 1.0)), max_size=8))
def test_what_is_set_comes_back_from_the_file(tmp_path_factory: Any, choices: list[Any]) -> None:
    base = Settings.model_validate({"guidance": {"horizon_m": 7.0}})
    tuned = base
    for parameter, share in choices:
        value = parameter.low + share * (parameter.high - parameter.low)
        with contextlib.suppress(RefusedError):  # a slowest speed above the fastest
            tuned = changed(tuned, parameter, round(value) if parameter.whole else value)
    path = tmp_path_factory.mktemp("state") / "tuned.toml"
    path.write_text(as_toml(base, tuned))
    assert with_tuned(base, path) == tuned
    assert bool(differences(base, tuned)) == (tuned != base)


def test_a_file_that_is_not_there_changes_nothing(tmp_path: Path) -> None:
    assert with_tuned(Settings(), tmp_path / "none") == Settings()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[guidance]\nhorizon_m = -3", "guidance.horizon_m"),
        ("[guidance]\nhorizn_m = 3", "did you mean 'horizon_m'"),
        ("[guidance", "not valid TOML"),
        ("guidance = 3", "guidance"),
        ("\x00\x01", "not valid TOML"),
    ],
)
def test_a_damaged_file_is_one_clear_line(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "tuned.toml"
    path.write_text(text)
    with pytest.raises(SettingsError) as caught:
        with_tuned(Settings(), path)
    line = str(caught.value)
    assert line.startswith(str(path)) and reason in line and "delete it" in line and "\n" not in line


@given(st.binary(max_size=60))
def test_any_bytes_for_a_file_are_settings_or_one_line(tmp_path_factory: Any, data: bytes) -> None:
    path = tmp_path_factory.mktemp("state") / "tuned.toml"
    path.write_bytes(data)
    try:
        assert isinstance(with_tuned(Settings(), path), Settings)
    except SettingsError as error:
        assert "\n" not in str(error)


# The conversation ---------------------------------------------------------------------------------------------------


def test_the_whole_list_comes_one_by_one_and_no_faster_however_often_it_is_asked_for() -> None:
    ground = Ground()
    answers = ground.ask(*[ParametersAsked(0.0)] * 1000)
    assert len(answers) == 1
    answers += ground.ask(ticks=len(TABLE) + 5)
    assert [answer.index for answer in answers] == list(range(len(TABLE)))
    assert {answer.count for answer in answers} == {len(TABLE)}
    assert [answer.value for answer in answers] == [parameter.value(Settings()) for parameter in TABLE]
    assert ground.now_s - 100.0 >= len(TABLE) * ANSWER_S


def test_one_is_read_by_name_or_index_and_others_names_are_not_answered() -> None:
    ground = Ground()
    assert [a.name for a in ground.ask(ParameterAsked(0.0, "CMP_STALE", -1))] == ["CMP_STALE"]
    assert [a.name for a in ground.ask(ParameterAsked(0.0, "", 2))] == [TABLE[2].name]
    silent = (("WP_SPEED", -1), ("", len(TABLE)), ("", 32767), ("", -1))
    assert ground.ask(*[ParameterAsked(0.0, name, index) for name, index in silent], ticks=5) == []


def test_a_value_is_set_answered_told_and_kept() -> None:
    ground = Ground()
    assert [(a.name, a.value) for a in ground.set("CMP_HORIZON", 6.0)] == [("CMP_HORIZON", 6.0)]
    assert ground.settings.current.guidance.horizon_m == 6.0
    assert ground.kept == [ground.settings.current]
    assert ground.notices.told == [("CMP_HORIZON 8 -> 6", 6)]
    ground.set("CMP_HORIZON", 6.0)
    assert len(ground.kept) == len(ground.notices.told) == 1  # nothing new
    ground.set("CMP_DOUBTS", 1.0)
    assert ground.notices.told[-1][0] == "CMP_DOUBTS 3 -> 1, from the next leg on"


def test_a_wrong_value_is_answered_with_the_old_one_and_the_reason() -> None:
    ground = Ground()
    assert [(a.name, a.value) for a in ground.set("CMP_HORIZON", 600.0)] == [("CMP_HORIZON", 8.0)]
    assert ground.notices.told == [("CMP_HORIZON stays 8: 600 not in 2..30", 4)]
    assert ground.kept == [] and ground.settings.current == Settings()


def test_the_autopilots_names_are_not_ours_unless_said_to_us() -> None:
    ground = Ground()
    ground.set("WP_SPEED", 2.0, to_us=False)
    assert ground.notices.told == []
    ground.set("WP_SPEED", 2.0)
    assert ground.notices.told == [("The companion has no parameter WP_SPEED", 4)]


def test_a_flood_of_changes_is_taken_in_slowly_and_in_bounded_room() -> None:
    ground = Ground()
    flood = [ParameterChangeAsked(0.0, f"N{i}", 1.0, to_us=True) for i in range(1000)]
    flood += [ParameterChangeAsked(0.0, "CMP_HORIZON", 2.0 + 0.01 * i, to_us=True) for i in range(1000)]
    ground.ask(*flood, ticks=20)
    assert len(ground.notices.told) <= 6
    ground.ask(ticks=1000)
    assert len(ground.notices.told) <= MOST_OPEN


def test_texts_fit_one_statustext() -> None:
    for parameter in TABLE:
        ground = Ground()
        ground.set(parameter.name, 123456.78)
        ground.set(parameter.name, parameter.high if parameter.value(Settings()) != parameter.high else parameter.low)
        assert len(ground.notices.told) == 2
        for text, _ in ground.notices.told:
            assert len(text) <= 50, text


# On the wire --------------------------------------------------------------------------------------------------------


def codec() -> Codec:
    known = Codec(Settings().link)
    known.decode(Station().heartbeat(), 0.0)
    return known


@pytest.mark.parametrize(("system", "component", "heard"), [
    (1, 191, True), (1, 0, True), (0, 0, True), (0, 191, True),
    (1, 1, False), (1, 154, False), (2, 191, False), (2, 0, False),
])  # fmt: skip
def test_a_request_counts_if_it_is_for_us_or_for_everybody(system: int, component: int, heard: bool) -> None:
    station = Station(255, 190)
    listing = station.pack(mavlink.MAVLink_param_request_list_message(system, component))
    assert codec().decode(listing, 1.0) == ([ParametersAsked(1.0)] if heard else [])
    setting = station.pack(mavlink.MAVLink_param_set_message(system, component, b"cmp_stale", 2.0, 9))
    wanted = ParameterChangeAsked(1.0, "CMP_STALE", 2.0, component == 191)
    assert codec().decode(setting, 1.0) == ([wanted] if heard else [])


def test_before_the_vehicle_is_known_nothing_is_answered() -> None:
    listing = Station(255, 190).pack(mavlink.MAVLink_param_request_list_message(1, 191))
    assert Codec(Settings().link).decode(listing, 1.0) == []


@given(st.binary(min_size=16, max_size=16), st.integers(-32768, 32767), st.floats(width=32))
def test_any_name_index_and_value_are_survived(name: bytes, index: int, value: float) -> None:
    station, ground, known = Station(255, 190), Ground(), codec()
    for message in (
        mavlink.MAVLink_param_request_read_message(1, 191, name, index),
        mavlink.MAVLink_param_set_message(1, 191, name, value, 9),
    ):
        for event in known.decode(station.pack(message), 1.0):
            ground.ask(event, ticks=10)
    for text, _ in ground.notices.told:
        assert text.isascii() and text.isprintable()


def test_the_answer_on_the_wire() -> None:
    for command, kind in (
        (ParameterValue("CMP_ARRIVAL", 0.5, 9, 26), mavlink.MAV_PARAM_TYPE_REAL32),
        (ParameterValue("CMP_DOUBTS", 3.0, 14, 26, whole_number=True), mavlink.MAV_PARAM_TYPE_INT32),
    ):
        message = mavlink.MAVLink(None).decode(bytearray(codec().encode(command)))
        assert (message.get_srcSystem(), message.get_srcComponent()) == (1, 191)
        told = (message.param_id, message.param_value, message.param_type, message.param_index, message.param_count)
        assert told == (command.name, command.value, kind, command.index, 26)


def test_the_page_lists_every_parameter() -> None:
    page = (Path(__file__).parents[3] / "docs" / "tuning.md").read_text(encoding="utf-8")
    rows = [
        f"| `{one.name}` | `{one.section}.{one.key}` | {one.low:g} | {one.high:g} "
        f"| {'from the next leg on' if one.next_leg else 'at once'} |"
        for one in TABLE
    ]
    assert "\n".join(rows) in page


def test_no_section_that_is_held_by_value_can_be_tuned() -> None:
    """Batteries, fence and link are given their section once; a change while driving would not reach them."""
    assert not {parameter.section for parameter in TABLE} & {"power", "fence", "link"}
