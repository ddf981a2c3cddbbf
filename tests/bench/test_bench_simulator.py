"""What one simulated second costs the simulator alone, with the companion's stream rates and a lidar."""

from typing import Any

import numpy as np
import pytest

from sitl.simulator import SimStart, Simulator
from sitl.world import World
from tests.sitl_client import HOME, ready


@pytest.mark.parametrize("sensors", ["lidar-90", "lidar-360", "beams"])
def test_one_simulated_second(benchmark: Any, sensors: str) -> None:
    obstacles = np.random.default_rng(1).random((50, 100)) < 0.05
    obstacles[22:28] = False
    simulator = Simulator(World(obstacles), SimStart(25.0, 5.0, 0.0, HOME), sensors)
    client = ready(simulator)
    for number, rate_hz in ((30, 20), (32, 10), (193, 5), (132, 10)):
        client.command(511, number, 1e6 / rate_hz)
    client.drive_to(0.0, 90.0)
    client.run_for(1.0)

    def second() -> None:
        began_s = simulator.time_s
        for tick in range(1, 21):
            simulator.advance_to_s(began_s + tick * 0.05)
            client.link.take()

    benchmark(second)
    # The contract: 50 times real time for everything together leaves the simulator about 6 ms.
    assert benchmark.stats.stats.median < 0.006
