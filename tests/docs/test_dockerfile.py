"""The Dockerfile by its parts: what it copies exists, what it installs is ours, its labels are those of BlueOS."""

from __future__ import annotations

import fnmatch
import json
import os
import re
import shlex
import shutil
import subprocess
import tomllib

import pytest
import typer

from tests.docs.test_docs import APPS, ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
DOCKER = shutil.which("docker")


def instructions() -> list[tuple[str, str]]:
    """Instruction and rest of each logical line; a line that ends in a backslash goes on in the next."""
    lines = [line for line in (ROOT / "Dockerfile").read_text(encoding="utf-8").splitlines() if line[:1] != "#"]
    joined = re.sub(r"\\\n", "", "\n".join(lines))
    return [(line.split()[0], line.split(maxsplit=1)[1]) for line in joined.splitlines() if line.strip()]


def labels() -> dict[str, str]:
    """The labels, with the arguments' defaults put in."""
    arguments = dict(rest.split("=", 1) for name, rest in instructions() if name == "ARG")
    found = {}
    for name, rest in instructions():
        if name == "LABEL":
            for word in shlex.split(rest):
                key, _, value = word.partition("=")
                found[key] = re.sub(r"\$\{(\w+)\}", lambda match: arguments[match[1]], value)
    return found


def test_instructions_are_known_and_in_a_working_order() -> None:
    names = [name for name, _ in instructions()]
    known = {"FROM", "WORKDIR", "COPY", "RUN", "USER", "ENV", "VOLUME", "ENTRYPOINT", "CMD", "ARG", "LABEL"}
    assert set(names) == known and names[0] == "FROM"
    run = [number for number, name in enumerate(names) if name == "RUN"]
    assert names.index("USER") > max(run), "what is installed belongs to root"
    assert dict(instructions())["USER"] == "rover"
    bases = {rest.split()[0] for name, rest in instructions() if name == "FROM"}
    (base,) = bases
    version = re.fullmatch(r"python:(3\.\d+)-slim-bookworm", base)
    assert version is not None and f"Programming Language :: Python :: {version[1]}" in PROJECT["classifiers"]


def test_what_is_copied_exists_and_is_not_ignored() -> None:
    kept = [line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")]
    copied = [
        words[:-1] for name, rest in instructions() if name == "COPY" and "--from" not in (words := rest.split())[0]
    ]
    sources = {source for words in copied for source in words}
    assert sources == set(kept)
    assert all((ROOT / source).exists() for source in sources)
    needed = {PROJECT["readme"], *PROJECT["license-files"]}
    assert needed <= sources
    data = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["data-files"]
    assert {pattern.split("/")[0] for patterns in data.values() for pattern in patterns} <= sources


def test_what_is_installed_is_our_wheel_with_an_extra_that_exists() -> None:
    (install,) = (rest for name, rest in instructions() if name == "RUN" and rest.startswith("pip install"))
    (extra,) = re.findall(r"\[(\w+)\]", install)
    assert extra in PROJECT["optional-dependencies"] and "-c /constraints.txt" in install
    (pattern,) = re.findall(r"/wheel/(\S+\.whl)", install)
    assert fnmatch.fnmatch(f"{PROJECT['name'].replace('-', '_')}-{PROJECT['version']}-py3-none-any.whl", pattern)
    for name, rest in instructions():
        if name == "RUN":
            assert subprocess.run(["sh", "-n", "-c", rest], check=False).returncode == 0, rest


def test_it_starts_a_command_that_exists() -> None:
    parts = dict(instructions())
    (program,) = json.loads(parts["ENTRYPOINT"])
    words = json.loads(parts["CMD"])
    command = typer.main.get_command(APPS[program]).commands[words[0]]  # type: ignore[attr-defined]
    options = {option for parameter in command.params for option in parameter.opts}
    assert {word for word in words if word.startswith("--")} <= options
    assert "--arm" not in words, "a person arms"
    assert words[1].startswith(parts["VOLUME"])


def test_the_labels_are_those_of_a_blueos_extension() -> None:
    found = labels()
    texts = {"version", "type", "requirements", "readme"}
    values = {name: json.loads(value) for name, value in found.items() if name not in texts}
    assert set(values) == {"permissions", "authors", "company", "tags", "links"}
    assert found["version"] == PROJECT["version"] and re.fullmatch(r"core >= \d+\.\d+", found["requirements"])
    assert found["type"] in {"device-integration", "example", "theme", "tool", "other"}
    assert "{tag}" in found["readme"] and found["readme"].endswith("docs/install.md")
    assert all({"name", "email"} <= set(author) for author in values["authors"])
    assert {"name", "about", "email"} <= set(values["company"])
    host = values["permissions"]["HostConfig"]
    assert host["NetworkMode"] == "host" and host["Binds"] == ["rover-companion-data:/data"]
    assert all(isinstance(tag, str) for tag in values["tags"]) and len(values["tags"]) <= 10


@pytest.mark.slow
@pytest.mark.skipif(DOCKER is None or os.environ.get("CI") == "true", reason="no docker, or one without its engine")
def test_it_is_built_where_docker_is() -> None:
    assert DOCKER is not None
    if subprocess.run([DOCKER, "info"], capture_output=True, check=False, timeout=60).returncode:
        pytest.skip("docker has no engine here")
    subprocess.run([DOCKER, "build", "-q", "."], check=True, cwd=ROOT, timeout=500)
