"""Memory of large arrays goes back to the system."""

from __future__ import annotations

import subprocess
import sys

import pytest

from companion.core.heap import LARGE_BYTES

PROGRAM = f"""
import os
import numpy as np
from companion.core.heap import return_large_blocks

def held_mb() -> float:
    pages = int(open("/proc/self/statm").read().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6

if {{returned}}:
    assert return_large_blocks()
# Once one of them was freed, the C library takes those of its size from its heap, where a small one above holds them.
first = np.ones({LARGE_BYTES} // 4)
del first
before = held_mb()
large, held = [], []
for _ in range(8):
    large.append(np.ones({LARGE_BYTES} // 8))
    held.append(np.ones(4000))
del large
print(held_mb() - before)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_large_arrays_that_are_freed_leave_the_process() -> None:
    kept_mb = [
        float(
            subprocess.run(
                [sys.executable, "-c", PROGRAM.format(returned=one)], stdout=subprocess.PIPE, check=True
            ).stdout
        )
        for one in (True, False)
    ]
    assert kept_mb[0] < 5.0 and kept_mb[0] <= kept_mb[1], kept_mb
