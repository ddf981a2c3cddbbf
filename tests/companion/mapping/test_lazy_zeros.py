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


def test_a_written_column_of_a_large_raster_takes_little_memory() -> None:
    """A page for each of its rows: half of it all where a page has 16 kB, a tenth where it has 4 kB."""
    zeros = lazy_zeros((5000, 8192), np.float32)
    before = resident_b()
    assert not zeros.any()
    assert resident_b() - before < 0.02 * zeros.nbytes, "read only"
    zeros[:, 5000] = 1.0
    assert 0.9 * 5000 * mmap.PAGESIZE < resident_b() - before < 1.3 * 5000 * mmap.PAGESIZE


def test_a_kernel_that_knows_no_huge_pages_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mmap, "MADV_NOHUGEPAGE", 12345)
    zeros = lazy_zeros((3000, 2000), np.float32)
    zeros[2999, 1999] = 1.0
    assert zeros.sum() == 1.0


def resident_b() -> int:
    """Of this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * mmap.PAGESIZE
