"""What tests of several packages start from."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.whole import Whole


@pytest.fixture
def whole(tmp_path: Path) -> Whole:
    """A whole companion, before its first tick."""
    return Whole(tmp_path)
