"""Memory of large arrays goes back to the system as soon as they are freed."""

from __future__ import annotations

import ctypes

LARGE_BYTES = 4 * 2**20
MMAP_THRESHOLD = -3  # M_MMAP_THRESHOLD of glibc's malloc.h


def return_large_blocks() -> bool:
    """Take blocks of ``LARGE_BYTES`` and more from the system each, for this process. Returns whether that is so.

    The C library (glibc, mallopt) does that from 128 KB on, but raises its limit to the size of each block that is
    freed, up to 32 MB. From then on arrays as large as a map come from its heap, which keeps them.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    return mallopt is not None and mallopt(MMAP_THRESHOLD, LARGE_BYTES) == 1
