"""What a ground station comes into: a simulator, the companion that drives it over one link, a witness on another."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

from tests.clients.program import Program, ours
from tests.sitl.network.test_server import free_port
from tests.support.rig import GUIDED, yard
from tests.support.served import PATIENCE_S, PATIENT, mission_path

SPEEDUP = 5
CRUISE_M_S = 0.4
"""Five times as fast, that is the 2 m/s the companion is made for: to it, time runs as on the wall."""
HOME_DEG = (53.1325, 23.1688)
PLACES = ((HOME_DEG[0] - 3.6e-5, HOME_DEG[1] + 1.8e-4), (HOME_DEG[0] + 6e-5, HOME_DEG[1] + 9e-5))
"""For missions; from the last target the way to the first one is clear."""
LATITUDE_M = 111_320.0
PREARM = 1 << 28
TARGETS = '[[target]]\nname = "gate"\nfield = [15, 7]\n[[target]]\nname = "corner"\nfield = [20, 2]\n'


def metres_from_home(lat_deg: float, lon_deg: float) -> tuple[float, float]:
    """North and east; good to a centimetre over a yard."""
    return (
        (lat_deg - HOME_DEG[0]) * LATITUDE_M,
        (lon_deg - HOME_DEG[1]) * LATITUDE_M * math.cos(math.radians(HOME_DEG[0])),
    )


class Witness:
    """Somebody else on the vehicle's TCP port, to see what is so without asking the client under test."""

    def __init__(self, port: int) -> None:
        self.link: Any = mavutil.mavlink_connection(f"tcp:127.0.0.1:{port}", source_system=254, source_component=190)
        self.mode, self.armed = -1, False
        self.truth_deg, self.speed_m_s = HOME_DEG, 0.0
        self.told: dict[str, float] = {}
        """Parameters, as the autopilot tells everybody of a change."""
        self.wait(lambda m: m.get_type() == "HEARTBEAT")

    def _look(self, message: Any) -> None:
        kind = message.get_type()
        if kind == "HEARTBEAT" and message.get_srcComponent() == 1:
            self.mode, self.armed = message.custom_mode, bool(message.base_mode & 128)
        elif kind == "SIMSTATE":
            self.truth_deg = (message.lat * 1e-7, message.lng * 1e-7)
        elif kind == "VFR_HUD":
            self.speed_m_s = message.groundspeed
        elif kind == "PARAM_VALUE":
            self.told[message.param_id] = message.param_value

    def wait(self, fits: Callable[[Any], bool], limit_s: float = PATIENCE_S) -> Any:
        """The first message that fits, of all that has not been looked at yet."""
        stop_s = time.monotonic() + limit_s
        while time.monotonic() < stop_s:
            message = self.link.recv_match(blocking=True, timeout=1.0)
            if message is not None:
                self._look(message)
                if fits(message):
                    return message
        pytest.fail(f"not within {limit_s} s")

    def look(self) -> None:
        """Take in all that has come up to now."""
        while (message := self.link.recv_match(blocking=False)) is not None:
            self._look(message)

    def until(self, done: Callable[[], bool], limit_s: float = PATIENCE_S) -> None:
        """Until something is so for the witness."""
        if not done():
            self.wait(lambda _: done(), limit_s)

    def place_m(self) -> tuple[float, float]:
        """Where the rover really is: metres north and east of home."""
        self.look()
        return metres_from_home(*self.truth_deg)

    def items(self, kind: int) -> list[Any]:
        """Mission (0), fence (1) or rally points (2) as the autopilot has them."""
        self.link.mav.mission_request_list_send(1, 1, kind)
        count = self.wait(lambda m: m.get_type() == "MISSION_COUNT" and m.mission_type == kind).count
        found = []
        for seq in range(count):
            self.link.mav.mission_request_int_send(1, 1, seq, kind)
            found.append(self.wait(lambda m, seq=seq: m.get_type() == "MISSION_ITEM_INT" and m.seq == seq))
        self.link.mav.mission_ack_send(1, 1, 0, kind)
        return found


@dataclass
class Scene:
    """All that is there before the ground station comes."""

    tcp: int
    udp: int
    serve: Program
    companion: Program
    witness: Witness

    def may_be_armed(self) -> None:
        """The companion asks for a person to arm, and the autopilot's checks are passed."""
        self.companion.says("a person to arm")
        self.witness.look()
        self.witness.wait(lambda m: m.get_type() == "SYS_STATUS" and bool(m.onboard_control_sensors_health & PREARM))

    def driving(self) -> None:
        """The companion drives: it is there, in GUIDED, armed, and the rover gets on from here."""
        before_m = self.witness.place_m()
        self.witness.until(lambda: math.dist(metres_from_home(*self.witness.truth_deg), before_m) > 0.3)
        assert self.companion.child.poll() is None
        assert (self.witness.mode, self.witness.armed) == (GUIDED, True)

    def arrived(self) -> None:
        """The companion has ended as if nobody else had been there, and the rover touched nothing."""
        assert self.companion.ended() == 0, self.companion.output
        assert "gate: reached" in self.companion.output and "corner: reached" in self.companion.output
        assert "Traceback" not in self.companion.output
        self.untouched()

    def untouched(self) -> None:
        """The simulator is up and has told of no collision."""
        assert self.serve.child.poll() is None
        assert "collision" not in self.serve.output and "Traceback" not in self.serve.output


@contextmanager
def scene(folder: Path, companion_on: str, *options: object) -> Iterator[Scene]:
    """``companion_on``: tcp or udp; the ground station gets the other one. ``options`` go to the companion."""
    path = mission_path(yard(folder, TARGETS))
    path.write_text(path.read_text().replace("cruise_speed_m_s = 2.0", f"cruise_speed_m_s = {CRUISE_M_S}"))
    tcp, udp = free_port(), free_port(socket.SOCK_DGRAM)
    listen = [f"tcp:127.0.0.1:{tcp}", f"udpout:127.0.0.1:{udp}"]
    sitl = ["serve", path, "--listen", listen[0], "--listen", listen[1], "--speedup", SPEEDUP]
    url = {"tcp": f"tcp:127.0.0.1:{tcp}", "udp": f"udpin:127.0.0.1:{udp}"}[companion_on]
    with ours(folder, "sitl", *sitl) as serve:
        serve.says(f"sending to {listen[1]}")
        (folder / "patient.toml").write_text(PATIENT)
        kept = ("--state", folder / "state", "--settings", folder / "patient.toml")
        run = ["run", path, "--connect", url, *kept, *options]
        with ours(folder, "companion", *run) as companion:
            witness = Witness(tcp)
            try:
                yield Scene(tcp, udp, serve, companion, witness)
            finally:
                witness.link.close()
