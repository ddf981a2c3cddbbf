"""The report as one HTML file: the viewer's page with everything that it needs inside it, and the data of a record.

Nouns: report page.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
import re
from pathlib import Path

PAGE = Path(__file__).parent / "page"
LIVE_ONLY = ("viewer/live.js",)


def report_page(title: str, data: bytes) -> str:
    """One file that loads nothing. ``data``: JSON, as docs/viewer.md says."""
    style = "\n".join((PAGE / name).read_text(encoding="utf-8") for name in ("vendor/uPlot.min.css", "viewer.css"))
    # The same data gives the same file: gzip would write the time of day into it.
    record = base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()
    parts = {
        "<!--TITLE-->": html.escape(title),
        "<!--STYLE-->": f"<style>{style}</style>",
        "<!--IMPORTMAP-->": f'<script type="importmap">{_import_map()}</script>',
        "<!--RECORD-->": f'<script id="record" type="application/octet-stream">{record}</script>',
    }
    text = (PAGE / "report.html").read_text(encoding="utf-8")
    return re.sub("|".join(parts), lambda found: parts[found.group()], text)


def _import_map() -> str:
    """The modules of the live page under the same names, each as a data URL: a file may load no other files."""
    index = (PAGE / "index.html").read_text(encoding="utf-8")
    found = re.search(r'<script type="importmap">(.*?)</script>', index, re.DOTALL)
    assert found is not None
    imports = json.loads(found.group(1))["imports"]
    kept = {name: _data_url(PAGE.parent / file) for name, file in imports.items() if name not in LIVE_ONLY}
    return json.dumps({"imports": kept})


def _data_url(file: Path) -> str:
    return f"data:text/javascript;base64,{base64.b64encode(file.read_bytes()).decode()}"
