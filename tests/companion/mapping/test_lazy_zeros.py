"""Arrays of zeros that take memory only where something has been written."""

from __future__ import annotations

import mmap
from pathlib import Path

import numpy as np
import pytest

from companion.mapping.lazy_zeros import lazy_zeros


@pytest.mark.parametrize("shape", [(3, 5), (3000, 2000)])
@pytest.mark.parametrize("dtype", [np.float32, np.int32, np.bool_])
def test_they_are_zero_and_can_be_written(shape: tuple[int, int], dtype: type) -> None:
    zeros = lazy_zeros(shape, dtype)
    assert zeros.shape == shape and zeros.dtype == dtype and not zeros.any()
    zeros[1, 2] = 1
    assert zeros.sum() == 1 and zeros.flags.c_contiguous and zeros.flags.aligned


def test_a_written_column_of_a_large_raster_takes_a_page_a_row() -> None:
    zeros = lazy_zeros((5000, 10000), np.float32)
    before = resident_pages()
    assert not zeros.any()
    assert resident_pages() - before < 500, "read only"
    zeros[:, 5000] = 1.0
    assert 4000 < resident_pages() - before < 7000


def resident_pages() -> int:
    """Of this process, in pages of 4 kB."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * mmap.PAGESIZE // 4096
