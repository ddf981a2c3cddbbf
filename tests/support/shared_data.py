"""Where recordings, real maps and real mission files lie, if this checkout has them beside it."""

import os
from pathlib import Path

import pytest

SHARED = Path(os.environ.get("ROVER_SHARED", Path(__file__).resolve().parents[2].parent / "shared"))
needs_shared = pytest.mark.skipif(not (SHARED / "data").is_dir(), reason="no shared data beside the checkout")
