"""What holds for every test."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from companion.cli import kernels

kernels.use_cache(os.environ)  # before a test imports numba


@pytest.fixture(scope="session", autouse=True)
def own_place_for_states(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Runs without a state directory do not use that of the user, nor that of another worker."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("states")))
        yield
