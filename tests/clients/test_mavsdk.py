"""MAVSDK as the ground station beside a companion that drives."""

from __future__ import annotations

import asyncio
import json
import math
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest

from tests.clients.program import AGAIN_S, installed
from tests.clients.scene import CRUISE_M_S, HOME_DEG, PLACES, Scene, metres_from_home, scene
from tests.support.rig import HOLD
from tests.support.served import PATIENCE_S

WAYPOINT, RELATIVE, TEMPORARILY_REJECTED = 16, 3, 1
"""The last one is what it answers while it stands because the computer is busy."""


async def first(values: AsyncIterator[Any], fits: Callable[[Any], bool] = lambda _: True) -> Any:
    """The first value of a subscription that fits."""

    async def look() -> Any:
        async for value in values:
            if fits(value):
                return value

    return await asyncio.wait_for(look(), PATIENCE_S)


class Ground:
    """MAVSDK's plugins for one vehicle."""

    def __init__(self, system: Any) -> None:
        from mavsdk.asyncio.plugins.action import ActionAsync
        from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
        from mavsdk.asyncio.plugins.param import ParamAsync
        from mavsdk.asyncio.plugins.telemetry import TelemetryAsync

        self.action, self.telemetry = ActionAsync(system), TelemetryAsync(system)
        self.mission, self.param = MissionRawAsync(system), ParamAsync(system)


async def telemetry(ground: Ground, here: Scene) -> None:
    """What MAVSDK tells of the vehicle is what the witness sees."""
    told = ground.telemetry
    assert await first(told.subscribe_armed(), bool)
    health = await first(told.subscribe_health(), lambda one: one.is_global_position_ok and one.is_home_position_ok)
    assert health.is_armable
    await told.set_rate_position(10.0)
    place = await first(told.subscribe_position())
    away_m = math.dist(metres_from_home(place.latitude_deg, place.longitude_deg), here.witness.place_m())
    assert away_m < 2.0  # it drives on between the two looks
    velocity = await first(told.subscribe_velocity_ned(), lambda v: math.hypot(v.north_m_s, v.east_m_s) > 0.1)
    assert math.hypot(velocity.north_m_s, velocity.east_m_s) < 1.5 * CRUISE_M_S
    await told.set_rate_home(1.0)
    home = await first(told.subscribe_home())
    assert (home.latitude_deg, home.longitude_deg) == pytest.approx(HOME_DEG, abs=1e-7)


async def parameters(ground: Ground, here: Scene) -> None:
    """One read, one set, all of them."""
    assert await ground.param.get_param_float("WP_SPEED") == pytest.approx(CRUISE_M_S)
    await ground.param.set_param_float("RTL_SPEED", 0.25)
    assert await ground.param.get_param_float("RTL_SPEED") == 0.25
    here.witness.until(lambda: here.witness.told.get("RTL_SPEED") == 0.25)
    everything = await ground.param.get_all_params()
    named = {one.name: one.value for one in (*everything.float_params, *everything.int_params)}
    assert named["RTL_SPEED"] == 0.25 and named["MAV_SYSID"] == 1


async def mission(ground: Ground, here: Scene) -> None:
    """Up, down, and looked at by somebody else."""
    from mavsdk.asyncio.plugins.mission_raw import MissionItem

    items = [
        MissionItem(seq, RELATIVE, WAYPOINT, int(seq == 0), 1, float(seq), 0, 0, 0, round(lat * 1e7), round(lon * 1e7))
        for seq, (lat, lon) in enumerate((HOME_DEG, *PLACES))
    ]
    await ground.mission.upload_mission(items)
    back = await ground.mission.download_mission()
    wanted = [(item.command, item.x, item.y, item.param1) for item in items[1:]]
    for found in (back, here.witness.items(0)):
        assert [(item.command, item.x, item.y, item.param1) for item in found[1:]] == wanted


async def drive(ground: Ground, here: Scene) -> None:
    """The companion has gone: MAVSDK sends the rover to a place, and stops it there."""
    await ground.action.arm()
    await ground.action.goto_location(*PLACES[0], 120.0, 0.0)
    goal_m = metres_from_home(*PLACES[0])

    def near(place: Any) -> bool:
        return math.dist(metres_from_home(place.latitude_deg, place.longitude_deg), goal_m) < 1.5

    await first(ground.telemetry.subscribe_position(), near)
    await ground.action.hold()
    here.witness.until(lambda: here.witness.mode == HOLD and here.witness.speed_m_s < 0.05)
    assert math.dist(here.witness.place_m(), goal_m) < 2.0


async def requested_goal(system: Any, here: Scene) -> None:
    """A place for the companion itself: MAVSDK's own targets go to the autopilot, so the message is written out."""
    from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync, MavlinkMessage

    direct = MavlinkDirectAsync(system)
    answers = direct.subscribe_message("COMMAND_ACK")
    fields = {
        "target_system": 1, "target_component": 191, "frame": 6, "command": 192, "current": 0, "autocontinue": 0,
        "param1": -1.0, "param2": 0.0, "param3": 0.0, "param4": 0.0,
        "x": round(PLACES[0][0] * 1e7), "y": round(PLACES[0][1] * 1e7), "z": 0.0,
    }  # fmt: skip
    answer, stop_s = {"result": TEMPORARILY_REJECTED}, time.monotonic() + PATIENCE_S
    while answer["result"] == TEMPORARILY_REJECTED and time.monotonic() < stop_s:
        heard = asyncio.ensure_future(first(answers, lambda m: m.component_id == 191))
        await asyncio.sleep(AGAIN_S)
        await direct.send_message(MavlinkMessage("COMMAND_INT", 0, 0, 1, 191, json.dumps(fields)))
        answer = json.loads((await heard).fields_json)
    assert (answer["command"], answer["result"]) == (192, 0)
    here.companion.says("Reached requested goal 1")


async def session(here: Scene) -> None:
    from mavsdk.asyncio import ComponentType, Configuration, Mavsdk

    async with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as sdk:
        await sdk.add_any_connection(f"udpin://127.0.0.1:{here.udp}")
        system = await sdk.first_autopilot(timeout_s=PATIENCE_S)
        assert system is not None
        ground = Ground(system)
        here.may_be_armed()
        await ground.action.arm()
        here.driving()
        await telemetry(ground, here)
        await parameters(ground, here)
        await mission(ground, here)
        # A place to go to is overruled by the companion's next target, as the companion drives.
        await ground.action.goto_location(*PLACES[0], 120.0, 0.0)
        here.driving()
        await requested_goal(system, here)
        here.arrived()
        await drive(ground, here)
        here.untouched()


@pytest.mark.slow
def test_mavsdk_beside_the_companion(tmp_path: Path) -> None:
    installed("mavsdk", "mavsdk")
    with scene(tmp_path, companion_on="tcp") as here:
        asyncio.run(session(here))
        assert here.serve.child.poll() is None, "the simulator is up to the end"
