"""What is in a report's HTML file."""

from __future__ import annotations

import base64
import gzip
import json
import re
from pathlib import Path
from typing import Any


def report_data_in(file: Path) -> dict[str, Any]:
    """The data that the page in the file shows."""
    found = re.search(r'<script id="record"[^>]*>([^<]+)</script>', file.read_text(encoding="utf-8"))
    assert found is not None
    data: dict[str, Any] = json.loads(gzip.decompress(base64.b64decode(found[1])))
    return data
