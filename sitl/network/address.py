"""Opens the endpoint named by a ``--listen`` address."""

from __future__ import annotations

import errno
import os

from sitl.network.endpoint import LINK_REMEDY, Endpoint, ListenError, network_address
from sitl.network.event_log import EventLog
from sitl.network.serial import DEFAULT_BAUD, HIGHEST_BAUD, Device, PseudoTerminal, SerialEndpoint
from sitl.network.tcp import TcpServer
from sitl.network.udp import UdpEndpoint
from sitl.simulator import Simulator

FORMS = "tcp:HOST:PORT, udpout:HOST:PORT, udpin:HOST:PORT, serial:PATH[:BAUD] or pty:PATH"
TAKEN = "stop the other program, or choose another port with --listen"
ELSEWHERE = "is that an address of this computer?"
REMEDIES = {
    "serial": "check that the device exists and that you may use it",
    "pty": LINK_REMEDY,
}


def open_endpoint(url: str, simulator: Simulator, log: EventLog | None = None, serial_port: int = 0) -> Endpoint:
    """Open an address of one of the ``FORMS``; clients connect to the vehicle's serial port ``serial_port`` (SERIALn).

    ``tcp`` listens, ``udpout`` sends first, ``udpin`` waits, ``serial`` is a device, ``pty`` creates a
    pseudo-terminal and a link to it. ``log`` reports clients. Raises ListenError.
    """
    kind, _, place = url.partition(":")
    log = log or EventLog()
    try:
        if kind in ("serial", "pty") and place:
            return SerialEndpoint(_line(kind, place), simulator, serial_port)
        host, port = network_address(url, FORMS)
        if kind == "tcp":
            return TcpServer(host, port, log, serial_port)
        return UdpEndpoint(host, port, kind == "udpin", simulator, log, serial_port)
    except (OSError, ValueError) as error:
        number = getattr(error, "errno", None)
        # pyserial repeats the path and the error number in its text.
        reason = os.strerror(number) if kind == "serial" and number else getattr(error, "strerror", None) or error
        if kind == "pty" and number == errno.EEXIST and os.path.islink(place):
            reason = f"{reason}, perhaps another rover-sitl has it"
        remedy = REMEDIES.get(kind, TAKEN if number == errno.EADDRINUSE else ELSEWHERE)
        raise ListenError(f"{url}: cannot be opened: {reason}; {remedy}") from error


def _line(kind: str, place: str) -> Device | PseudoTerminal:
    if kind == "pty":
        return PseudoTerminal(place)
    path, _, baud = place.rpartition(":")
    if path and baud.isascii() and baud.isdigit():
        if not 0 < int(baud) <= HIGHEST_BAUD:
            raise ListenError(f"serial:{place}: {baud:.20} is not a baud rate; choose one up to {HIGHEST_BAUD}")
        return Device(path, int(baud))
    return Device(place, DEFAULT_BAUD)
