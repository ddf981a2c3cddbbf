"""Lazy zeros: arrays of zeros that take memory only where something has been written.

``numpy.zeros`` asks for huge pages: with rows of tens of kilobytes, one written cell then takes two megabytes, and a
drive along a large raster takes all of it.

Nouns: lazy zeros.
"""

from __future__ import annotations

import contextlib
import math
import mmap
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

LEAST_BYTES = 4_000_000
"""Smaller arrays are whole pages soon."""


def lazy_zeros(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Like ``numpy.zeros``. Memory is taken a small page at a time, by the first write to it; reading takes none.

    Raises OSError where the address space is too small.
    """
    kind = np.dtype(dtype)
    count = math.prod(shape)
    if count * kind.itemsize < LEAST_BYTES:
        return np.zeros(shape, kind)
    pages = mmap.mmap(-1, count * kind.itemsize, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    if hasattr(mmap, "MADV_NOHUGEPAGE"):
        with contextlib.suppress(OSError):  # a kernel without huge pages, as a Raspberry Pi's, refuses the advice
            pages.madvise(mmap.MADV_NOHUGEPAGE)
    return np.frombuffer(pages, kind, count).reshape(shape)
