"""Links over real sockets on the loopback, a pseudo terminal, and memory."""

import os
import socket
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from companion.mavlink.byte_link import BackOff, OutBuffer
from companion.mavlink.transport import (
    ByteLink,
    LinkError,
    MemoryLink,
    SerialLink,
    TcpLink,
    TcpServerLink,
    UdpLink,
    open_link,
)
from tests.support.notices import HandClock
from tests.support.served import Stopwatch

PATIENCE_S = 60.0


def eventually(condition: Callable[[], bool]) -> None:
    """Give the kernel its time: even on the loopback, bytes do not arrive at once."""
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s, "did not happen in time"
        time.sleep(0.002)


def read_all(link: ByteLink, expected: bytes) -> None:
    got = bytearray()

    def arrived() -> bool:
        got.extend(link.read())
        return len(got) >= len(expected)

    eventually(arrived)
    assert bytes(got) == expected


@pytest.fixture
def clock() -> HandClock:
    return HandClock(100.0)


@pytest.fixture
def server() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(PATIENCE_S)
        yield listener


class TestMemory:
    def test_both_ways_in_order(self) -> None:
        near, far = MemoryLink.pair()
        near.write(b"one")
        near.write(b"two")
        far.write(b"back")
        assert (far.read(), far.read(), near.read()) == (b"onetwo", b"", b"back")

    def test_what_was_written_cannot_be_changed_later(self) -> None:
        near, far = MemoryLink.pair()
        data = bytearray(b"abc")
        near.write(data)  # type: ignore[arg-type]
        data[0] = 0
        assert far.read() == b"abc"


class TestUdp:
    def test_answers_to_everybody_who_has_spoken(self) -> None:
        link = UdpLink("127.0.0.1", 0, bind=True)
        first, second = (UdpLink("127.0.0.1", link.port, bind=False) for _ in range(2))
        assert "nobody" in link.description
        link.write(b"too early")
        assert link.read() == b""
        first.write(b"a")
        read_all(link, b"a")
        second.write(b"b")
        read_all(link, b"b")
        link.write(b"answer")
        read_all(first, b"answer")
        read_all(second, b"answer")
        assert "nobody" not in link.description
        for each in (link, first, second):
            each.close()

    def test_forgets_the_longest_silent_of_many(self) -> None:
        link = UdpLink("127.0.0.1", 0, bind=True)
        peers = [UdpLink("127.0.0.1", link.port, bind=False) for _ in range(9)]
        for number, peer in enumerate(peers):
            peer.write(bytes([number]))
            read_all(link, bytes([number]))
        link.write(b"x")
        for peer in peers[1:]:
            read_all(peer, b"x")
        assert peers[0].read() == b""
        for each in (link, *peers):
            each.close()

    def test_nobody_listening_is_no_error(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as spare:
            spare.bind(("127.0.0.1", 0))
            port = spare.getsockname()[1]
        link = UdpLink("127.0.0.1", port, bind=False)
        for _ in range(3):
            link.write(b"hello?")
            assert link.read() == b""
        link.close()

    def test_a_taken_port_is_one_line(self) -> None:
        link = UdpLink("127.0.0.1", 0, bind=True)
        with pytest.raises(LinkError, match=r"^udpin:127\.0\.0\.1:\d+: cannot listen: .*choose another port$"):
            UdpLink("127.0.0.1", link.port, bind=True)
        link.close()

    def test_a_flood_does_not_hold_up_a_read(self) -> None:
        link = UdpLink("127.0.0.1", 0, bind=True)
        peer = UdpLink("127.0.0.1", link.port, bind=False)
        for _ in range(40):
            peer.write(bytes(5000))
        eventually(lambda: len(link.read()) > 0)
        for _ in range(40):
            peer.write(bytes(5000))
        assert len(link.read()) < 65536 + 5000
        link.close()
        peer.close()


class TestTcpClient:
    def connected(self, server: socket.socket, clock: HandClock) -> tuple[TcpLink, socket.socket]:
        link = TcpLink("127.0.0.1", server.getsockname()[1], clock)
        peer, _ = server.accept()
        eventually(lambda: link.read() == b"" and link.connected)
        return link, peer

    def test_both_ways(self, server: socket.socket, clock: HandClock) -> None:
        link, peer = self.connected(server, clock)
        peer.sendall(b"from the rover")
        read_all(link, b"from the rover")
        link.write(b"to the rover")
        assert peer.recv(100) == b"to the rover"
        link.close()
        assert peer.recv(100) == b""
        peer.close()
        assert link.read() == b""

    def test_a_peer_that_dies_and_comes_back(self, server: socket.socket, clock: HandClock) -> None:
        link, peer = self.connected(server, clock)
        peer.close()
        eventually(lambda: link.read() == b"" and not link.connected)
        assert "not connected" in link.description
        link.write(b"lost")
        clock.time_s += 10.0
        link.read()
        again, _ = server.accept()
        eventually(lambda: link.read() == b"" and link.connected)
        again.sendall(b"I am back")
        read_all(link, b"I am back")
        link.close()
        again.close()

    def test_a_peer_that_breaks_off(self, server: socket.socket, clock: HandClock) -> None:
        link, peer = self.connected(server, clock)
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\x00\x00\x00\x00\x00\x00\x00")
        peer.close()

        def gone() -> bool:
            link.write(b"anybody there?")
            return not link.connected

        eventually(gone)
        assert "not connected" in link.description
        link.close()

    def test_a_server_that_comes_late(self, clock: HandClock) -> None:
        with socket.create_server(("127.0.0.1", 0)) as spare:
            port = spare.getsockname()[1]
        link = TcpLink("127.0.0.1", port, clock)
        for _ in range(20):
            clock.time_s += 1.0
            assert link.read() == b""
        assert not link.connected
        with socket.create_server(("127.0.0.1", port)) as late:
            late.settimeout(PATIENCE_S)
            clock.time_s += 10.0
            link.read()
            peer, _ = late.accept()
            eventually(lambda: link.read() == b"" and link.connected)
            peer.close()
        link.close()

    def test_a_peer_that_does_not_read_loses_whole_packets_only(self, server: socket.socket, clock: HandClock) -> None:
        link, peer = self.connected(server, clock)
        packet = b"<" + bytes(998) + b">"
        with Stopwatch() as watch:
            for _ in range(8000):
                link.write(packet)
        assert watch.quiet_s < 3.0, "writing never waits"
        received = bytearray()
        peer.settimeout(0.3)
        try:
            while True:
                received += peer.recv(1 << 20)
                link.read()
        except TimeoutError:
            pass
        assert 0 < len(received) < 8000 * len(packet)
        assert bytes(received) == packet * (len(received) // len(packet))
        link.close()
        peer.close()


class TestTcpServer:
    def test_the_newest_client_counts(self) -> None:
        link = TcpServerLink("127.0.0.1", 0)
        link.write(b"nobody there")
        assert link.read() == b"" and "nobody" in link.description
        first = socket.create_connection(("127.0.0.1", link.port), timeout=PATIENCE_S)
        first.sendall(b"first")
        read_all(link, b"first")
        second = socket.create_connection(("127.0.0.1", link.port), timeout=PATIENCE_S)
        second.sendall(b"second")
        read_all(link, b"second")
        link.write(b"answer")
        assert second.recv(100) == b"answer"
        assert first.recv(100) == b""
        second.close()
        eventually(lambda: link.read() == b"" and "nobody" in link.description)
        first.close()
        link.close()

    def test_a_taken_port_is_one_line(self) -> None:
        link = TcpServerLink("127.0.0.1", 0)
        with pytest.raises(LinkError, match=r"^tcpin:.*cannot listen"):
            TcpServerLink("127.0.0.1", link.port)
        link.close()


class TestSerial:
    @pytest.fixture
    def wire(self, tmp_path: Path) -> Iterator[tuple[int, int, Path]]:
        """The rover's end, the companion's end, and a device name that can be plugged out and in."""
        rover, device = os.openpty()
        tty.setraw(rover)
        tty.setraw(device)
        os.set_blocking(rover, False)
        name = tmp_path / "ttyACM0"
        name.symlink_to(os.ttyname(device))
        yield rover, device, name
        for end in (rover, device):
            try:
                os.close(end)
            except OSError:
                continue

    def test_both_ways(self, wire: tuple[int, int, Path], clock: HandClock) -> None:
        rover, _, name = wire
        link = SerialLink(str(name), 115200, clock)
        os.write(rover, b"\xfd\x00from the rover\x11\x13\n")
        read_all(link, b"\xfd\x00from the rover\x11\x13\n")
        link.write(b"\xfdto the rover\x03\x04")
        eventually(lambda: os.read(rover, 100) == b"\xfdto the rover\x03\x04")
        assert link.read() == b""
        link.close()
        link.close()

    def test_unplugged_and_plugged_in_again(self, wire: tuple[int, int, Path], clock: HandClock) -> None:
        rover, device, name = wire
        link = SerialLink(str(name), 57600, clock)
        os.close(device)
        os.close(rover)
        eventually(lambda: link.read() == b"" and "not there" in link.description)
        link.write(b"lost")
        clock.time_s += 1.5
        assert link.read() == b"" and "not there" in link.description
        new_rover, new_device = os.openpty()
        tty.setraw(new_device)
        name.unlink()
        name.symlink_to(os.ttyname(new_device))
        assert link.read() == b"" and "not there" in link.description, "not yet: it waits between tries"
        clock.time_s += 10.0
        assert link.read() == b"" and "not there" not in link.description
        os.write(new_rover, b"back")
        read_all(link, b"back")
        link.close()
        for end in (new_rover, new_device):
            os.close(end)

    def test_a_device_that_is_not_there_is_one_line(self, clock: HandClock) -> None:
        with pytest.raises(LinkError, match=r"^serial:/dev/ttyNONE:57600: cannot be opened: there is no such device"):
            SerialLink("/dev/ttyNONE", 57600, clock)

    def test_a_device_in_use_is_one_line(self, wire: tuple[int, int, Path], clock: HandClock) -> None:
        link = SerialLink(str(wire[2]), 115200, clock)
        with pytest.raises(LinkError, match="another program uses it"):
            SerialLink(str(wire[2]), 115200, clock)
        link.close()


class TestUrls:
    @pytest.mark.parametrize(
        ("url", "description"),
        [
            ("udpin:127.0.0.1:0", "udpin:127.0.0.1:0 (nobody has spoken yet)"),
            ("udp:127.0.0.1:0", "udpin:127.0.0.1:0 (nobody has spoken yet)"),
            ("udpout:localhost:14550", "udpout:localhost:14550"),
            ("tcp:127.0.0.1:9", "tcp:127.0.0.1:9 (not connected: connection refused)"),
            ("tcpin:127.0.0.1:0", "tcpin:127.0.0.1:0 (nobody is connected)"),
            ("tcpin:[::1]:0", "tcpin:::1:0 (nobody is connected)"),
        ],
    )
    def test_a_network_link(self, url: str, description: str) -> None:
        try:
            link = open_link(url)
        except LinkError as error:
            assert "::1" in url
            pytest.skip(f"no IPv6 loopback here: {error}")
        assert link.description == description
        link.close()

    @pytest.mark.parametrize(
        ("form", "baud"),
        [
            ("serial:{}:57600", 57600),
            ("serial:{}", 115200),
            ("{}", 115200),
            ("{},57600", 57600),
            ("{}:9600", 9600),
            ("serial:{},9600", 9600),
        ],
    )
    def test_a_serial_link(self, form: str, baud: int) -> None:
        rover, device = os.openpty()
        name = os.ttyname(device)
        link = open_link(form.format(name))
        assert link.description == f"serial:{name}:{baud}"
        link.close()
        for baud_text in ("0", "299", "12000001", "99999999999"):
            with pytest.raises(LinkError, match="is no baud rate from 300 to 12000000"):
                open_link(f"serial:{name}:{baud_text}")
        with pytest.raises(LinkError, match=r"'1\.0' is not a baud rate .a device with a colon in its name needs one"):
            open_link("serial:/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0")
        for url in ("serial:", "serial::9600"):
            with pytest.raises(LinkError, match="names no device"):
                open_link(url)
        os.close(rover)
        os.close(device)

    def test_a_device_may_have_colons_in_its_name(self) -> None:
        place = "/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0"
        with pytest.raises(LinkError, match=f"serial:{place}:115200: "):
            open_link(place)
        with pytest.raises(LinkError, match=f"serial:{place}:57600: "):
            open_link(f"{place},57600")

    @pytest.mark.parametrize(
        "url",
        [
            "", "nonsense", "http://rover", "udpin", "udpin:14550", "udpout:127.0.0.1", "tcp:127.0.0.1:port",
            "tcp::5760", "tcp:127.0.0.1:70000", "udpin:127.0.0.1:-1", "serial:/dev/ttyX:fast", "/dev/ttyX,",
            "tcp://127.0.0.1:5760",
        ],
    )  # fmt: skip
    def test_a_bad_url_is_one_line_with_the_forms(self, url: str) -> None:
        with pytest.raises(LinkError) as caught:
            open_link(url)
        text = str(caught.value)
        assert "\n" not in text and "udpin:HOST:PORT" in text and "serial:DEVICE:BAUD" in text
        assert repr(url) in text

    @pytest.mark.parametrize(
        ("url", "lack"),
        [("udp:14550", "no host"), ("udpin::14550", "no host"), ("tcp:rover", "no port"), ("udp://:1", "no //")],
    )
    def test_what_a_url_lacks_is_told(self, url: str, lack: str) -> None:
        with pytest.raises(LinkError, match=lack):
            open_link(url)

    def test_an_unknown_host_is_one_line(self) -> None:
        with pytest.raises(LinkError, match="host 'no such host' is not known"):
            open_link("tcp:no such host:5760")


def test_back_off_doubles_up_to_its_limit() -> None:
    back_off = BackOff(first_s=1.0, limit_s=4.0)
    tries = [second for second in range(20) if back_off.due(float(second))]
    assert tries == [0, 1, 3, 7, 11, 15, 19]
    back_off.reset()
    assert back_off.due(19.1)


def test_a_full_buffer_drops_whole_packets() -> None:
    buffer = OutBuffer()
    for _ in range(70):
        buffer.add(bytes(1000))
    assert len(buffer.waiting) == 65000 and buffer.dropped == 5
    buffer.taken(64999)
    buffer.add(b"new")
    assert bytes(buffer.waiting) == b"\0new"
    buffer.clear()
    assert not buffer.waiting
