"""Link faults: shares of packets lost, late, duplicated, damaged and reordered; directions and links."""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import math
import socket
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.faults.link_faults import LinkQueue, Packets
from sitl.faults.plan import FaultPlan, LinkEffect, LinkFault
from sitl.network import open_endpoint
from sitl.network.endpoint import datagrams
from sitl.network.server import serve
from sitl.simulator import Simulator
from tests.sitl.network.test_server import free_port
from tests.support.sitl_client import Client, open_ground, ready

SENT = 4000
"""Packets in each statistic. With probability p the share differs by more than 5 standard deviations in one run of
1.7 million."""


def packets(count: int) -> list[bytes]:
    mav = mavlink.MAVLink(None, 1, 1)
    made = []
    for number in range(count):
        mav.seq = number % 256
        made.append(bytes(mavlink.MAVLink_system_time_message(number, number).pack(mav)))
    return made


def through(*faults: LinkFault, count: int = SENT, every_s: float = 0.02, seed: int = 0) -> list[tuple[float, bytes]]:
    """Packets sent one by one from 0 s on: when which bytes arrived."""
    way = LinkQueue(1, "from_vehicle")
    rngs = [(fault, np.random.default_rng([seed, i])) for i, fault in enumerate(faults)]
    arrived = []
    for number, packet in enumerate(packets(count)):
        now_s = number * every_s
        way.pass_on(packet, now_s, lambda fault, now_s=now_s: fault.at(now_s)[0], rngs)  # type: ignore[misc]
        arrived += [(now_s, one) for one in Packets().cut(way.arrived(now_s))]
    arrived += [(math.inf, one) for one in Packets().cut(way.arrived(math.inf))]
    return arrived


def numbers(data: list[tuple[float, bytes]]) -> list[int]:
    mav = mavlink.MAVLink(None)
    return [m.time_boot_ms for _, one in data for m in mav.parse_buffer(one) or []]


def within(count: int, probability: float, of: int = SENT) -> bool:
    return abs(count - probability * of) <= 5.0 * math.sqrt(of * probability * (1.0 - probability))


@pytest.mark.parametrize("probability", [0.05, 0.3, 0.9])
def test_loss(probability: float) -> None:
    left = numbers(through(LinkFault(effect=LinkEffect.LOSS, probability=probability)))
    assert within(SENT - len(left), probability)
    assert left == sorted(left)


def test_losses_do_not_depend_on_each_other() -> None:
    left = set(numbers(through(LinkFault(effect=LinkEffect.LOSS, probability=0.5))))
    pairs = sum(n not in left and n + 1 not in left for n in range(0, SENT, 2))
    assert within(pairs, 0.25, SENT // 2)


@pytest.mark.parametrize("probability", [0.05, 0.5])
def test_duplicates(probability: float) -> None:
    came = numbers(through(LinkFault(effect=LinkEffect.DUPLICATE, probability=probability)))
    assert within(len(came) - SENT, probability)
    assert came == sorted(came)
    assert set(came) == set(range(SENT))


@pytest.mark.parametrize("probability", [0.05, 0.5])
def test_corruption(probability: float) -> None:
    sent = packets(SENT)
    way = LinkQueue(1, "from_vehicle")
    rng = np.random.default_rng(5)
    came = []
    for packet in sent:
        way.pass_on(
            packet, 0.0, lambda fault: True, [(LinkFault(effect=LinkEffect.CORRUPT, probability=probability), rng)]
        )
        came.append(way.arrived(0.0))
    assert [len(one) for one in came] == [len(one) for one in sent]
    damaged = [sum(a != b for a, b in zip(one, was, strict=True)) for one, was in zip(came, sent, strict=True)]
    assert within(sum(count > 0 for count in damaged), probability)
    assert max(damaged) <= 3


def test_delay_and_jitter() -> None:
    came = through(LinkFault(effect=LinkEffect.DELAY, delay_s=0.5, jitter_s=0.2), every_s=0.02)
    sent_s = {number: 0.02 * number for number in range(SENT)}
    order = numbers(came)
    assert order == list(range(SENT)), "a slow line keeps the order"
    late_s = [at_s - sent_s[n] for n, (at_s, _) in zip(order, came, strict=True) if math.isfinite(at_s)]
    assert min(late_s) >= 0.5 - 1e-6
    assert max(late_s) <= 0.72 + 1e-6
    assert 0.6 < float(np.mean(late_s)) < 0.72


def test_reordering() -> None:
    came = numbers(through(LinkFault(effect=LinkEffect.REORDER, probability=0.1, delay_s=0.05)))
    assert sorted(came) == list(range(SENT))
    overtaken = sum(one > after for one, after in pairwise(came))
    # Each that is held back is overtaken by the next two, unless the one before was held back too and comes out first.
    assert 0.06 * SENT < overtaken < 0.11 * SENT


def test_outage_is_from_begin_to_end() -> None:
    left = numbers(through(LinkFault(2.0, 4.0, effect=LinkEffect.OUTAGE), count=300))
    assert left == [*range(100), *range(200, 300)]


@given(cuts=st.lists(st.integers(1, 60), max_size=20), noise=st.binary(max_size=30))
def test_packets_are_cut_however_the_bytes_come(cuts: list[int], noise: bytes) -> None:
    noise = bytes(b for b in noise if b not in (0xFD, 0xFE))
    old = mavlink.MAVLink(None, 1, 1)
    version_1 = bytes(mavlink.MAVLink_system_time_message(1, 1).pack(old, force_mavlink1=True))
    whole = [packets(1)[0], version_1, *([noise] if noise else []), packets(2)[1]]
    data, cutter, pieces = b"".join(whole), Packets(), []
    for size in cuts:
        pieces += cutter.cut(data[:size])
        data = data[size:]
    pieces += cutter.cut(data)
    assert b"".join(pieces) == b"".join(whole)
    assert [one for one in pieces if one[0] in (0xFD, 0xFE)] == [one for one in whole if one[0] in (0xFD, 0xFE)]


@given(data=st.binary(max_size=600))
def test_any_bytes_can_be_cut_and_sent(data: bytes) -> None:
    cutter = Packets()
    pieces = cutter.cut(data)
    assert data.startswith(b"".join(pieces))
    assert b"".join(datagrams(data)) == data


def hardened(client: Client) -> Client:
    """A client that lives with damaged bytes."""
    client._parser.robust_parsing = True
    return client


# In the simulator ----------------------------------------------------------------------------------------------------


def plan(*faults: LinkFault, seed: int = 0) -> FaultPlan:
    return FaultPlan(faults, seed)


def streamed(simulator: Simulator, seconds: float = 40.0) -> tuple[Client, Client]:
    """Two clients that get ATTITUDE at 20 Hz; both have been there from the start."""
    first, second = Client(simulator), Client(simulator, 255, 190)
    first.run_to(5.0)
    second.run_to(5.0)
    for client in (first, second):
        client.command(511, 30, 50_000)
    first.run_to(10.0)
    second.run_to(10.0)
    first.received.clear()
    second.received.clear()
    first.run_to(10.0 + seconds)
    second.run_to(10.0 + seconds)
    return first, second


def test_only_the_links_that_are_meant_lose_packets() -> None:
    fault = LinkFault(10.0, effect=LinkEffect.LOSS, probability=0.5, links=(2,))
    first, second = streamed(open_ground(faults=plan(fault)))
    assert len(first.of("ATTITUDE")) == 800
    assert within(len(second.of("ATTITUDE")), 0.5, 800)


@pytest.mark.parametrize(
    ("direction", "heard", "answered"), [("to_vehicle", True, False), ("from_vehicle", False, True)]
)
def test_only_the_direction_that_is_meant_is_cut(direction: Any, heard: bool, answered: bool) -> None:
    client = Client(open_ground(faults=plan(LinkFault(45.0, effect=LinkEffect.OUTAGE, direction=direction))))
    client.run_to(46.0)
    client.received.clear()
    client.command(176, 1, 4)
    client.run_for(2.0)
    assert bool(client.received) == heard
    assert (client.simulator._vehicle.mode == 4) == answered
    assert client.of("COMMAND_ACK") == []


def test_what_is_late_arrives_to_the_loop() -> None:
    """A command 0.5 s late is answered 1 s after it was sent, within two main loops."""
    fault = LinkFault(45.0, effect=LinkEffect.DELAY, delay_s=0.5)
    client = Client(open_ground(faults=plan(fault)))
    client.run_to(50.0)
    client.command(511, 30, 100_000)
    answered_s = None
    while answered_s is None and client.simulator.time_s < 55.0:
        if any(m.get_type() == "COMMAND_ACK" for m in client.run_for(0.02)):
            answered_s = client.simulator.time_s
    assert answered_s == pytest.approx(51.0, abs=0.041)


def test_a_damaged_stream_leaves_simulator_and_clients_up() -> None:
    client = hardened(ready(open_ground(faults=plan(LinkFault(44.0, effect=LinkEffect.CORRUPT, probability=0.5)))))
    client.drive_to(20.0, 0.0)
    for _ in range(20):
        client.command(176, 1, 15)
        client.drive_to(20.0, 0.0)
        client.run_for(0.5)
    assert client.of("BAD_DATA")
    assert client.of("ATTITUDE")[-1].time_boot_ms > 45_000
    assert client.simulator.truth.north_m > 5.0


def fingerprint(faults: FaultPlan | None, seed: int, step_s: float = 0.1) -> str:
    simulator = open_ground(noise=True, seed=seed, faults=faults, sensors="lidar-90")
    client = hardened(Client(simulator))
    client.run_to(43.2)
    for number, values in ((176, (1, 15)), (400, (1,))):
        client.command(number, *values)
        client.run_for(0.1)
    client.drive_to(20.0, 3.0)
    while simulator.time_s < 55.0 - 1e-9:
        client.run_for(step_s)
    return hashlib.sha256(client.raw).hexdigest()


EVERYTHING = tuple(
    LinkFault(44.0, 53.0, effect=effect, probability=0.2, delay_s=0.1, jitter_s=0.1)
    for effect in LinkEffect
    if effect is not LinkEffect.OUTAGE
)


def test_same_seed_same_bytes() -> None:
    assert fingerprint(plan(*EVERYTHING), 1) == fingerprint(plan(*EVERYTHING), 1)
    assert fingerprint(plan(*EVERYTHING), 1) != fingerprint(plan(*EVERYTHING), 2)
    assert fingerprint(plan(*EVERYTHING), 1) != fingerprint(plan(*EVERYTHING, seed=1), 1)


def test_the_bytes_do_not_depend_on_how_often_one_looks() -> None:
    assert fingerprint(plan(*EVERYTHING), 1, 0.02) == fingerprint(plan(*EVERYTHING), 1, 0.1)


def test_a_plan_that_does_nothing_changes_no_byte() -> None:
    assert fingerprint(None, 3) == fingerprint(plan(LinkFault(1000.0, effect=LinkEffect.OUTAGE)), 3)


def test_on_the_network_links_count_in_the_order_in_which_they_open() -> None:
    """Two TCP clients of a served rover; the second one hears nothing for two seconds."""
    simulator = open_ground(
        faults=plan(LinkFault(4.0, 6.0, effect=LinkEffect.OUTAGE, direction="from_vehicle", links=(2,)))
    )
    port = free_port()
    endpoint = open_endpoint(f"tcp:127.0.0.1:{port}", simulator)
    looks = itertools.count(1)
    heard: list[list[int]] = []

    def run(until_s: float) -> None:
        began_s = simulator.time_s
        serve(
            simulator,
            [endpoint],
            lambda: began_s / 10.0 + 0.005 * next(looks),
            10.0,
            lambda: simulator.time_s < until_s,
        )

    try:
        with socket.create_connection(("127.0.0.1", port)) as first:
            run(1.0)
            with socket.create_connection(("127.0.0.1", port)) as second:
                run(8.5)
                for client in (first, second):
                    client.settimeout(0.2)
                    parser = mavlink.MAVLink(None)
                    data = b""
                    with contextlib.suppress(TimeoutError):
                        while piece := client.recv(65536):
                            data += piece
                    heard.append(
                        [m.time_boot_ms for m in parser.parse_buffer(data) or [] if m.get_type() == "ATTITUDE"]
                    )
    finally:
        endpoint.close()
    assert heard[0] == [3000, 4000, 5000, 6000, 7000, 8000]
    assert heard[1] == [3000, 6000, 7000, 8000]
