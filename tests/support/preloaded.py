"""What a forked program has loaded: the commands of both programs, and the kernels of drives and of the simulator."""

from __future__ import annotations

import os

from companion.cli import kernel_cache

kernel_cache.use_cache(os.environ)  # before numba is imported

import companion.cli.commands  # noqa: E402, F401
import sitl.cli.commands  # noqa: E402, F401
from sitl.cli.compile import drive, manoeuvres, physics, simulator  # noqa: E402

for job in (simulator, drive, manoeuvres, physics):
    job()
