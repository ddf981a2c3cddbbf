"""What decoding costs. Sixty messages a second must stay below one per cent of a core: 166 microseconds each."""

from typing import Any

from companion.mavlink.codec import Codec
from companion.settings import LinkSettings
from tests.support.mavlink_vehicle import Station

SECONDS = 10


def one_run(rover: Station, lidar: Station) -> list[bytes]:
    """Ten seconds of what a rover sends to the companion, tick by tick at 20 Hz, with a lidar at 15 Hz."""
    ticks = []
    for tick in range(20 * SECONDS):
        parts = [rover.local_position(50 * tick), rover.distance(300 + tick % 50)]
        parts += [lidar.cells([(100 + tick + i) % 800 + 20 for i in range(72)])] if tick % 4 else []
        parts += [rover.heartbeat(15, armed=True)] if tick % 20 == 0 else []
        ticks.append(b"".join(parts))
    return ticks


def test_decoding(benchmark: Any) -> None:
    ticks = one_run(Station(), Station(1, 196))

    def decode() -> int:
        codec = Codec(LinkSettings())
        return sum(len(codec.decode(data, 0.05 * tick)) for tick, data in enumerate(ticks))

    events = benchmark(decode)
    assert events > 500
    if benchmark.stats is not None:
        per_event_us = benchmark.stats.stats.median / events * 1e6
        benchmark.extra_info["us_per_event"] = per_event_us
        assert per_event_us < 166.0
