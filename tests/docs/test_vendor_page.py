"""The libraries of the viewer's page are those that the lock file beside them names, and nothing else is there."""

from __future__ import annotations

import json
import re
import runpy
from pathlib import Path
from typing import Any

MADE = runpy.run_path(str(Path(__file__).parents[2] / "docs" / "vendor_page.py"))
LOCK, VENDOR, integrity = MADE["LOCK"], MADE["VENDOR"], MADE["integrity"]
PACKAGES: list[dict[str, Any]] = json.loads(LOCK.read_text(encoding="utf-8"))["packages"]


def test_every_file_is_the_one_that_the_lock_names() -> None:
    locked = {name: file["integrity"] for package in PACKAGES for name, file in package["files"].items()}
    assert {file.name: integrity(file.read_bytes()) for file in VENDOR.iterdir() if file != LOCK} == locked


def test_each_library_has_its_licence_and_the_version_of_the_lock() -> None:
    for package in PACKAGES:
        assert re.fullmatch(r"sha512-[A-Za-z0-9+/]{86}==", package["integrity"])
        texts = {file["of"]: (VENDOR / name).read_text(encoding="utf-8") for name, file in package["files"].items()}
        assert f"The {package['licence']} License" in texts["LICENSE"]
        code = [text for name, text in texts.items() if name.endswith(".js")]
        assert code and all(f"(v{package['version']})" in text for text in code)


def test_the_page_takes_no_library_from_elsewhere() -> None:
    page = VENDOR.parent
    found = re.search(r'<script type="importmap">(.*?)</script>', (page / "index.html").read_text("utf-8"), re.DOTALL)
    assert found is not None
    files = [page.parent / file.lstrip("/") for file in json.loads(found[1])["imports"].values()]
    assert files and all(file.is_file() for file in files)
    assert {file.name for file in files if file.parent == VENDOR} == {"uPlot.esm.js"}
