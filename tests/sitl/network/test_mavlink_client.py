"""Lines to a network where somebody else listens: they come back, and never stand in the way."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager

import pytest

from sitl.network import ListenError
from sitl.network.mavlink_client import BACKLOG_BYTES, RETRY_S, ClientLink, open_link
from tests.sitl.network.test_server import free_port


@contextmanager
def listener(port: int) -> Iterator[socket.socket]:
    with socket.socket() as opened:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        opened.settimeout(5.0)
        opened.bind(("127.0.0.1", port))
        opened.listen()
        yield opened


def heard(link: ClientLink, now_s: float, size: int) -> bytes:
    """What arrives, until it is so much."""
    data = b""
    for _ in range(1000):
        data += link.exchange(b"", now_s)
        if len(data) >= size:
            break
    return data


def test_tcp_connects_when_somebody_listens_and_again_after_a_hang_up() -> None:
    port = free_port()
    with closing(open_link(f"tcp:127.0.0.1:{port}")) as link:
        assert link.exchange(b"lost", 0.0) == b""
        assert link.sockets() == []
        with listener(port) as server:
            assert link.exchange(b"too early to try again", 0.5 * RETRY_S) == b""
            assert link.sockets() == []
            link.exchange(b"hello", RETRY_S)
            with server.accept()[0] as peer:
                assert peer.recv(100) == b"hello"
                peer.sendall(b"beat")
                assert heard(link, RETRY_S, 4) == b"beat"
            while link.sockets():
                link.exchange(b"", RETRY_S)
            link.exchange(b"back", 2.0 * RETRY_S)
            with server.accept()[0] as peer:
                assert peer.recv(100) == b"back"


def test_tcp_hangs_up_on_somebody_who_does_not_read() -> None:
    port = free_port()
    with listener(port) as server, closing(open_link(f"tcp:127.0.0.1:{port}")) as link:
        link.exchange(b"", 0.0)
        with server.accept()[0]:
            for _ in range(1000):
                link.exchange(bytes(BACKLOG_BYTES // 2), 0.0)
                if not link.sockets():
                    break
            assert link.sockets() == []


def test_udpout_sends_to_its_partner_and_hears_it() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as partner:
        partner.settimeout(5.0)
        partner.bind(("127.0.0.1", 0))
        with closing(open_link(f"udpout:127.0.0.1:{partner.getsockname()[1]}")) as link:
            link.exchange(b"scan", 0.0)
            data, place = partner.recvfrom(100)
            assert data == b"scan"
            partner.sendto(b"beat", place)
            assert heard(link, 0.0, 4) == b"beat"


def test_udpin_sends_to_whoever_spoke() -> None:
    port = free_port()
    with closing(open_link(f"udpin:127.0.0.1:{port}")) as link:
        assert link.exchange(b"to nobody", 0.0) == b""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as partner:
            partner.settimeout(5.0)
            partner.sendto(b"beat", ("127.0.0.1", port))
            assert heard(link, 0.0, 4) == b"beat"
            link.exchange(b"scan", 0.0)
            assert partner.recv(100) == b"scan"


@pytest.mark.parametrize(
    "url",
    ["", "tcp", "tcp:127.0.0.1", "tcp:127.0.0.1:x", "serial:/dev/null:57600"],
)
def test_what_is_no_address_is_refused_with_the_forms(url: str) -> None:
    with pytest.raises(ListenError, match="not an address; write tcp:HOST:PORT"):
        open_link(url)


def test_a_port_in_use_is_refused() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        with pytest.raises(ListenError, match="cannot be opened: Address already in use; choose another port"):
            open_link(f"udpin:127.0.0.1:{other.getsockname()[1]}")


@pytest.mark.parametrize("kind", ["tcp", "udpout"])
def test_a_name_that_is_none_is_refused(kind: str) -> None:
    with pytest.raises(ListenError, match="is that the name or address of a computer"):
        open_link(f"{kind}:no..name:5762")
