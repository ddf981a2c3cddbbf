"""Modules of the page, run by node without a browser."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from companion.viewer.server import PAGE

NODE = shutil.which("node")
needs_node = pytest.mark.skipif(NODE is None, reason="no node: apt-get install nodejs")


def ran(folder: Path, script: str) -> Any:
    """What the script tells with ``tell(value)``. It imports the page's modules as ``./name.js``."""
    for file in PAGE.glob("*.js"):
        text = file.read_text(encoding="utf-8").replace('from "viewer/', 'from "./')
        (folder / file.name).write_text(text, encoding="utf-8")
    (folder / "package.json").write_text('{"type": "module"}', encoding="utf-8")
    tell = "const tell = (value) => { console.log(JSON.stringify(value)); process.exit(0); };\n"
    (folder / "script.js").write_text(tell + script, encoding="utf-8")
    done = subprocess.run([str(NODE), "script.js"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
