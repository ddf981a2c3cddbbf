"""The parameters that a rover should have: what is accepted, for whom, and that other tables agree."""

from __future__ import annotations

import math

import pytest

from companion.diagnosis.checks import PARAMETERS
from companion.vehicle.recommended_parameters import RECOMMENDED_PARAMETERS
from companion.vehicle.wanted_parameters import WantedParameter, for_rover, wanted_parameters
from sitl.autopilot.parameters import DEFAULTS

TABLE = {one.name: one for one in wanted_parameters(2.0)}


@pytest.mark.parametrize(
    ("name", "fine", "wrong"),
    [
        ("OA_TYPE", (0.0,), (1.0,)),
        ("GUID_OPTIONS", (0.0, 1.0), (64.0, 65.0)),
        ("GUID_TIMEOUT", (3.0, 1.0), (3.1,)),
        ("WP_RADIUS", (1.0, 2.0), (2.5,)),
        ("WP_SPEED", (2.0, 3.0, 2.0 - 1e-7), (1.9, 0.0)),
        ("SCR_ENABLE", (1.0,), (0.0,)),
        ("SCR_USER1", (300.0, 500.0, 900.0, 950.0), (951.0, 3000.0)),
        ("RCMAP_THROTTLE", (3.0,), (2.0,)),
    ],
)
def test_what_is_accepted(name: str, fine: tuple[float, ...], wrong: tuple[float, ...]) -> None:
    assert all(map(TABLE[name].accepts, fine)) and not any(map(TABLE[name].accepts, wrong))


def test_what_is_written_is_accepted_and_explained() -> None:
    for one in TABLE.values():
        assert one.accepts(one.value) and one.why and not one.accepts(math.nan), one.name


def test_types_are_those_of_the_firmware() -> None:
    assert {name: one.kind for name, one in TABLE.items()} == {name: DEFAULTS[name][1] for name in TABLE}


def test_guard_and_station_add_theirs() -> None:
    def names(table: tuple[WantedParameter, ...]) -> set[str]:
        return {one.name for one in table}

    table = wanted_parameters(0.5)
    plain = names(for_rover(table))
    assert names(for_rover(table, guard=True)) - plain == {"SCR_ENABLE", "SCR_USER1"}
    assert names(for_rover(table, station=True)) - plain == {"FS_GCS_ENABLE"}
    assert set(RECOMMENDED_PARAMETERS) <= plain


def test_the_doctor_looks_at_what_would_stop_a_mission() -> None:
    assert set(TABLE) <= set(PARAMETERS)
