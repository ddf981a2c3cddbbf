"""What a worker of a cluster does first: its kernels have the place and the rule of both programs.

This module must not load numba: that reads both when it is loaded. numba's own rule takes kernels for valid that were
compiled with constants of an older file.
"""

from __future__ import annotations

import os

from companion.cli.kernel_cache import use_cache


def begin() -> None:
    """Once in each worker, before its first run."""
    use_cache(os.environ)
