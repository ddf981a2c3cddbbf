"""The way to the first metre: what is awaited, and the command that would help."""

from __future__ import annotations

from dataclasses import replace

import pytest

from companion.safety.mode_latch import Control
from companion.safety.reasons import Reason, WaitReason
from companion.settings import SafetySettings
from companion.supervision.arming import arming_step
from companion.vehicle.commands import Arm, Command, SetMode
from companion.vehicle.events import RoverMode
from companion.vehicle.state import VehicleState
from tests.companion.safety.test_mode_latch import GUIDED, HOLD, MANUAL, vehicle

SETTINGS = SafetySettings()
AUTO = replace(vehicle(mode=RoverMode.AUTO), in_auto=True)


@pytest.mark.parametrize(
    ("seen", "arm", "awaited", "command"),
    [
        (VehicleState(), True, WaitReason.HEARTBEAT, None),
        (replace(vehicle(), origin=None), True, WaitReason.ORIGIN_AND_HOME, None),
        (replace(vehicle(), home=None), True, WaitReason.ORIGIN_AND_HOME, None),
        (vehicle(ekf=0), True, WaitReason.GOOD_DATA, None),
        (replace(vehicle(), scan_ahead=None), True, WaitReason.GOOD_DATA, None),
        (vehicle(mode=MANUAL, armed=False), False, WaitReason.GUIDED, SetMode(GUIDED)),
        (vehicle(mode=HOLD, armed=False), False, WaitReason.GUIDED, SetMode(GUIDED)),
        (vehicle(mode=HOLD), False, WaitReason.GUIDED, SetMode(GUIDED)),
        (vehicle(mode=MANUAL), True, WaitReason.PERSON_SETS_GUIDED, None),
        (vehicle(mode=RoverMode.AUTO), True, WaitReason.PERSON_SETS_GUIDED, None),
        (vehicle(armed=False), True, WaitReason.ARMING, Arm()),
        (vehicle(armed=False), False, WaitReason.PERSON_ARMS, None),
        (vehicle(), False, None, None),
        (vehicle(), True, None, None),
        (AUTO, False, None, None),
        (replace(AUTO, heartbeat=vehicle(mode=HOLD).heartbeat), False, WaitReason.PERSON_STARTS_AUTO, None),
    ],
)
def test_the_way_to_the_first_metre(
    seen: VehicleState, arm: bool, awaited: WaitReason | None, command: Command | None
) -> None:
    step = arming_step(seen, 10.0, SETTINGS, arm=arm)
    assert (None if step.awaited is None else step.awaited.kind) is awaited
    assert step.command == command


@pytest.mark.parametrize("mode", [MANUAL, HOLD])
@pytest.mark.parametrize("armed", [True, False])
def test_a_rover_that_a_person_took_out_of_guided_is_not_put_back(mode: int, armed: bool) -> None:
    step = arming_step(vehicle(mode=mode, armed=armed), 10.0, SETTINGS, arm=True, control=Control.PERSON)
    driven = armed and mode == MANUAL
    kind = WaitReason.PERSON_SETS_GUIDED if driven else WaitReason.PERSON_SETS_GUIDED_AGAIN
    assert step.command is None and step.awaited == Reason(kind)


def test_a_hindrance_keeps_it_from_guided() -> None:
    battery = Reason(WaitReason.CHARGED_BATTERY, ("battery at 12 %",))
    step = arming_step(vehicle(mode=HOLD), 10.0, SETTINGS, arm=True, hindrance=battery)
    assert (step.awaited, step.command) == (battery, None)
