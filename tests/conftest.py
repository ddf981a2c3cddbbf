"""What holds for every test."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="session", autouse=True)
def own_place_for_states(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Runs that are not told where to keep their state keep none in the user's own place, nor meet those of another worker there."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("states")))
        yield
