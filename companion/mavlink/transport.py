"""Opens the link that a URL names: UDP, TCP or serial."""

from __future__ import annotations

from companion.core.clock import Clock, WallClock
from companion.mavlink.byte_link import ByteLink, LinkError, MemoryLink
from companion.mavlink.serial_port import SerialLink
from companion.mavlink.tcp import TcpLink, TcpServerLink
from companion.mavlink.udp import UdpLink

FORMS = (
    "udpin:HOST:PORT, udp:HOST:PORT (the same), udpout:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT, "
    "serial:DEVICE:BAUD, /dev/ttyNAME or /dev/ttyNAME,BAUD"
)
DEFAULT_BAUD = 115200
LEAST_BAUD, MOST_BAUD = 300, 12_000_000

__all__ = [
    "FORMS",
    "ByteLink",
    "LinkError",
    "MemoryLink",
    "SerialLink",
    "TcpLink",
    "TcpServerLink",
    "UdpLink",
    "open_link",
]


def open_link(url: str, clock: Clock | None = None) -> ByteLink:
    """Open the link that a URL names; ``clock`` times reconnections.

    ``udp`` means listening, as in pymavlink. Raises LinkError with one line: an unknown form, a port in use, a missing
    device. A TCP server that does not answer yet is no error: the link tries again by itself.
    """
    clock = clock or WallClock()
    if url.startswith("/dev/"):
        return _serial(url, url, clock)
    kind, colon, rest = url.partition(":")
    if "://" in url:
        raise LinkError(f"'{url}': a link has no //; use {FORMS}")
    if not colon or kind not in {"udp", "udpin", "udpout", "tcp", "tcpin", "serial"}:
        raise LinkError(f"'{url}' is not a link; use {FORMS}")
    if kind == "serial":
        return _serial(rest, url, clock)
    host, colon, port_text = rest.rpartition(":")
    if not host:
        lacks = "host" if rest.strip(":").isdigit() else "port"
        raise LinkError(f"'{url}' names no {lacks}; use {FORMS}")
    host = host.removeprefix("[").removesuffix("]")
    port = _number(port_text, url, "port")
    if port > 65535:
        raise LinkError(f"'{url}': port {port} is out of range; use {FORMS}")
    match kind:
        case "tcp":
            return TcpLink(host, port, clock)
        case "tcpin":
            return TcpServerLink(host, port)
        case _:
            return UdpLink(host, port, bind=kind != "udpout")


def device_of(url: str) -> str | None:
    """The serial device that a URL names; None for a link over the network, or no link at all."""
    if url.startswith("/dev/"):
        return _device_and_baud(url, url)[0]
    return _device_and_baud(url.removeprefix("serial:"), url)[0] if url.startswith("serial:") else None


def _device_and_baud(place: str, url: str) -> tuple[str, str | None]:
    """The baud rate stands behind a comma (MAVProxy) or a colon (ArduPilot); None: it is not given."""
    device, sign, baud = place.rpartition("," if "," in place else ":")
    if place == url and sign == ":" and not baud.isdigit():  # /dev/serial/by-path names have colons of their own
        sign = ""
    return (device, baud) if sign else (place, None)


def _serial(place: str, url: str, clock: Clock) -> SerialLink:
    """A serial line."""
    device, baud = _device_and_baud(place, url)
    if device and baud is None:
        return SerialLink(device, DEFAULT_BAUD, clock)
    if not device or baud is None:
        raise LinkError(f"'{url}' names no device; use {FORMS}")
    rate = _number(baud, url, "baud rate", " (a device with a colon in its name needs one behind it)")
    if not LEAST_BAUD <= rate <= MOST_BAUD:
        raise LinkError(f"'{url}': {rate} is no baud rate from {LEAST_BAUD} to {MOST_BAUD}; use {FORMS}")
    return SerialLink(device, rate, clock)


def _number(text: str, url: str, what: str, hint: str = "") -> int:
    if not text.isascii() or not text.isdigit():
        raise LinkError(f"'{url}': '{text}' is not a {what}{hint}; use {FORMS}")
    return int(text)
