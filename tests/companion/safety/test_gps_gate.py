"""The GPS gate: when it shuts, and when it opens again."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.safety.gps_gate import GpsGate
from companion.safety.reasons import Doubt
from companion.settings import Settings
from companion.settings.live_settings import LiveSettings
from companion.vehicle.events import GpsSeen
from companion.vehicle.gps_fix import GpsFix
from companion.vehicle.state import VehicleState

TICK_S, EVERY_S = 0.05, 0.2
LOST_S, SETTLE_S = 1.0, 3.0
FLOAT, FIXED = GpsFix.RTK_FLOAT, GpsFix.RTK_FIXED


class Gated:
    """A gate in a loop of 20 ticks a second. ``row``: the fixes of the messages to come, five a second; None: none."""

    def __init__(self, needed: str = "rtk-fixed") -> None:
        safety = {"gps_fix": needed, "gps_lost_s": LOST_S, "gps_settle_s": SETTLE_S}
        self.gate = GpsGate(LiveSettings(Settings.model_validate({"safety": safety})))
        self.ticks = 0

    @property
    def now_s(self) -> float:
        return round(self.ticks * TICK_S, 6)

    def hear(self, *row: GpsFix | None) -> list[Doubt | None]:
        """The doubt in each tick."""
        found = []
        for fix in row:
            for tick in range(round(EVERY_S / TICK_S)):
                self.ticks += 1
                if fix is not None and tick == 0:
                    seen = GpsSeen(self.now_s, fix, 10, round(1e6 * self.now_s))
                    self.gate.take(seen, VehicleState())
                self.gate.tick(self.now_s)
                doubt = self.gate.doubt(self.now_s)
                found.append(None if doubt is None else doubt.kind)
        return found

    def opened(self) -> Gated:
        assert self.hear(*[FIXED] * 20)[-1] is None
        return self


def test_it_opens_once_the_fix_has_been_good_for_long_enough() -> None:
    gated = Gated()
    assert set(gated.hear(*[None] * 10)) == {Doubt.GPS_SILENT}
    doubts = gated.hear(*[FIXED] * 20)
    assert doubts.index(None) * TICK_S == pytest.approx(SETTLE_S, abs=2 * TICK_S)
    assert set(doubts) == {Doubt.GPS_SETTLES, None} and doubts[-1] is None


def test_any_fix_is_no_gate_even_where_there_is_no_gps() -> None:
    gated = Gated("any")
    assert set(gated.hear(None, None, None, GpsFix.NO_GPS, GpsFix.NO_FIX)) == {None}


@pytest.mark.parametrize(
    ("needed", "enough", "too_little"),
    [
        ("3d", GpsFix.FIX_3D, GpsFix.FIX_2D),
        ("dgps", GpsFix.DGPS, GpsFix.FIX_3D),
        ("rtk-float", FLOAT, GpsFix.DGPS),
        ("rtk-fixed", FIXED, FLOAT),
    ],
)
def test_each_gate_asks_for_its_fix_or_a_better_one(needed: str, enough: GpsFix, too_little: GpsFix) -> None:
    assert Gated(needed).hear(*[enough] * 20)[-1] is None
    assert Gated(needed).opened().hear(*[too_little] * 20)[-1] is Doubt.GPS_POOR


@pytest.mark.parametrize("bad", [FLOAT, GpsFix.NO_FIX, None])
def test_single_bad_messages_stop_nothing(bad: GpsFix | None) -> None:
    assert set(Gated().opened().hear(*[bad, FIXED, FIXED] * 20)) == {None}
    assert set(Gated().opened().hear(bad, bad, bad, *[FIXED] * 20)) == {None}


@pytest.mark.parametrize("row", [[FLOAT, FIXED], [FLOAT, FLOAT, FLOAT, FLOAT, FIXED]])
def test_a_fix_that_is_bad_more_often_than_not_shuts_it_though_good_ones_come_between(row: list[GpsFix]) -> None:
    gated = Gated().opened()
    assert Doubt.GPS_POOR in gated.hear(*row * 20)
    assert gated.hear(*row * 20)[-1] is not None, "it stays shut"
    assert gated.hear(*[FIXED] * 20)[-1] is None


@pytest.mark.parametrize(("bad", "says"), [(FLOAT, Doubt.GPS_POOR), (None, Doubt.GPS_SILENT)])
def test_a_worse_fix_that_stays_and_a_silence_shut_it_and_what_settles_opens_it(
    bad: GpsFix | None, says: Doubt
) -> None:
    gated = Gated().opened()
    doubts = gated.hear(*[bad] * 10)
    shut = next(number for number, doubt in enumerate(doubts) if doubt is not None)
    assert shut * TICK_S == pytest.approx(LOST_S - EVERY_S, abs=2 * TICK_S)
    assert doubts[-1] is says
    assert None not in gated.hear(*[FIXED] * 14, FLOAT, *[FIXED] * 14), "one break while it settles begins it anew"
    assert gated.hear(*[FIXED] * 3)[-1] is None


def test_a_packet_that_is_repeated_is_no_new_fix() -> None:
    gated = Gated().opened()
    stale = GpsSeen(0.0, FIXED, 10, round(1e6 * (gated.now_s - EVERY_S + TICK_S)))
    for _ in range(10):
        gated.gate.take(GpsSeen(gated.now_s, stale.fix, stale.satellites, stale.fix_us), VehicleState())
        doubts = gated.hear(None)
    assert doubts[-1] is Doubt.GPS_SILENT


@given(st.lists(st.sampled_from([None, FLOAT, FIXED]), min_size=1, max_size=80))
def test_whatever_comes_it_is_open_only_while_a_good_fix_is_fresh(row: list[GpsFix | None]) -> None:
    gated, good_s = Gated(), -1e9
    for fix in row:
        began_s = gated.now_s + TICK_S
        good_s = began_s if fix is FIXED else good_s
        for number, doubt in enumerate(gated.hear(fix)):
            if doubt is None:
                assert began_s + number * TICK_S - good_s <= LOST_S + 1e-6
