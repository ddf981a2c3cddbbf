"""A missing library is told with what it is for and the command that installs it."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from companion.core.extras import not_installed

EXTRAS = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]["optional-dependencies"]


def test_one_and_several_are_told_with_both_commands() -> None:
    commands = "pip install 'rover-companion[web]' (in the project's folder: .venv/bin/pip install -e '.[web]')"
    assert not_installed("--web", "web", "uvicorn") == f"--web: uvicorn is not installed; install it: {commands}"
    assert not_installed("--web", "web", "a", "b") == f"--web: a, b are not installed; install them: {commands}"


@pytest.mark.parametrize("package", ["companion", "sitl"])
def test_every_extra_that_is_named_exists(package: str) -> None:
    files = [file.read_text() for file in (Path(__file__).parents[3] / package).rglob("*.py")]
    named = {extra for text in files for extra in re.findall(r'not_installed\(.*?, "(\w+)", ', text)}
    assert named and named <= EXTRAS.keys()
