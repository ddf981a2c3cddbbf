"""Distances to the nearest marked cell, against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from companion.mapping.distance_field import FAR, distance_field

ndimage = pytest.importorskip("scipy.ndimage")

Rasters = arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 12)))


@given(Rasters)
def test_it_is_scipys(marked: np.ndarray) -> None:
    found = distance_field(marked)
    if not marked.any():
        assert (found == FAR).all()
        return
    assert found == pytest.approx(ndimage.distance_transform_edt(~marked), abs=1e-4)


def test_a_wide_field_is_exact_too() -> None:
    marked = np.random.default_rng(0).random((90, 240)) < 0.003
    assert distance_field(marked) == pytest.approx(ndimage.distance_transform_edt(~marked), abs=1e-3)
