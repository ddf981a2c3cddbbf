"""The tutorial runs from top to bottom, and prints what the page says."""

from __future__ import annotations

import contextlib
import io
import re
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.docs.test_docs import APPS, ROOT

PAGE = ROOT / "docs" / "tutorial.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
SAVED = {"python": "dogleg.py", "toml": "duel.toml"}
"""The files that the reader saves: the first block of each language."""
MODULES = ("dogleg", "proud")


class Reader:
    """Does what the page says, in a folder that has the missions."""

    def __init__(self, folder: Path) -> None:
        (folder / "missions").symlink_to(ROOT / "missions")
        self._names: dict[str, object] = {}
        self._unsaved = dict(SAVED)
        self._folder = folder

    def does(self, language: str, text: str) -> str:
        """What a block prints."""
        if language in self._unsaved:
            (self._folder / self._unsaved.pop(language)).write_text(text, encoding="utf-8")
            return ""
        if language == "sh":
            return "".join(self._ordered(line) for line in text.splitlines())
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(text, self._names)
        return printed.getvalue()

    def _ordered(self, line: str) -> str:
        program, *words = line.split()
        return CliRunner().invoke(APPS[Path(program).name], words).output


@pytest.fixture
def reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Reader:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    for module in MODULES:
        monkeypatch.delitem(sys.modules, module, raising=False)
    return Reader(tmp_path)


def read(reader: Reader, text: str) -> list[tuple[str, str]]:
    """What each text block of the page says, and what the block before it printed."""
    compared, printed = [], ""
    for language, block in BLOCK.findall(text):
        if language == "text":
            compared.append((plain(block), plain(printed)))
        else:
            printed = reader.does(language, block)
    return compared


def plain(text: str) -> str:
    return "\n".join(line.rstrip() for line in text.strip("\n").splitlines())


def test_the_planner_has_ten_lines() -> None:
    _, planner = BLOCK.findall(PAGE.read_text(encoding="utf-8"))[0]
    lines = [line for line in planner[planner.index("class ") :].splitlines() if line.strip()]
    assert len(lines) <= 10


def test_what_is_printed_before_the_first_drive_is_what_the_page_says(reader: Reader) -> None:
    head, marker, _ = PAGE.read_text(encoding="utf-8").partition("## On a rover")
    compared = read(reader, head)
    assert marker and len(compared) == 3
    for said, printed in compared:
        assert said == printed, "paste what is printed into docs/tutorial.md"


@pytest.mark.thorough
def test_drive_and_campaign_say_what_the_page_says(reader: Reader) -> None:
    *_, drive, (said, printed) = read(reader, PAGE.read_text(encoding="utf-8"))
    assert drive[0] == drive[1] and drive[0].startswith("reached"), drive
    assert said in printed, f"paste what is printed into docs/tutorial.md: {printed}"
