"""The design page is true: its layout, its nouns and its import floors are those of the modules."""

from __future__ import annotations

import ast
import configparser
import functools
import re
import runpy
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "design.md"
MOST_FLOORS = 14


@pytest.fixture(scope="module")
def made() -> dict[str, Any]:
    return runpy.run_path(str(ROOT / "docs" / "make_design.py"))


@functools.cache
def normal(text: str) -> str:
    """Lower case, words apart: ``MissionProgress`` and ``mission_progress`` both become ``mission progress``."""
    return re.sub(r"[\s_-]+", " ", re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", text)).lower()


@functools.cache
def stem_of(path: str) -> str:
    """The normal name of a module, in the singular."""
    return normal(Path(path).stem).removesuffix("s")


def defined(source: str) -> set[str]:
    """The normal names of all classes of a module."""
    return {normal(name) for name in re.findall(r"^ *class (\w+)", source, re.MULTILINE)}


def test_the_layout_and_the_nouns_are_those_of_the_modules(made: dict[str, Any]) -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert text == made["page"](text), "write it anew: .venv/bin/python docs/make_design.py"


def test_a_torn_line_of_the_layout_is_noticed(made: dict[str, Any]) -> None:
    text = PAGE.read_text(encoding="utf-8")
    torn = text.replace("    clock.py", ".py", 1)
    assert torn != text and made["page"](torn) == text


def own_words(path: str, source: str) -> str:
    """What a module is about: its name, its docstring, and the names that it defines. Imports do not count."""
    tree = ast.parse(source)
    words = [Path(path).stem, (ast.get_docstring(tree) or "").partition("\n\nNouns:")[0]]
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            words.append(node.name)
        if isinstance(node, ast.Assign | ast.AnnAssign):
            words.append(ast.unparse(node.targets[0] if isinstance(node, ast.Assign) else node.target))
    return normal(" . ".join(words))


def misplaced(module: Any, sources: dict[str, str], classes: dict[str, set[str]]) -> list[str]:
    """The nouns of a module that it does not say of itself, or that name another module or a class of another."""
    if not module.nouns:
        return []
    said = own_words(module.path, sources[module.path])
    wrong = [noun for noun in module.nouns if normal(noun) not in said]
    for noun in set(module.nouns) - set(wrong):
        name = normal(noun)
        homes = {path for path, names in classes.items() if name in names or stem_of(path) == name}
        homes = {path for path in homes if path.partition("/")[0] == module.path.partition("/")[0]}
        wrong += [noun] if homes and not any(module.path.startswith(home) for home in homes) else []
    return wrong


def test_every_noun_leads_to_the_file_that_speaks_of_it(made: dict[str, Any]) -> None:
    found = made["modules"]()
    sources = {}
    for module in found:
        file = ROOT / module.path / "__init__.py" if module.path.endswith("/") else ROOT / module.path
        sources[module.path] = file.read_text(encoding="utf-8")
    classes = {path: defined(source) for path, source in sources.items()}
    assert {module.path: wrong for module in found if (wrong := misplaced(module, sources, classes))} == {}
    grid = next(module for module in found if module.path == "companion/core/grid.py")
    strangers = made["Module"](grid.path, grid.says, ("genetic algorithm", "Pose"))
    assert misplaced(strangers, sources, classes) == ["genetic algorithm", "Pose"]
    for path, noun in (("supervision/arming.py", "mode latch"), ("supervision/pace.py", "watchdog")):
        module = made["Module"](f"companion/{path}", "", (noun,))
        assert misplaced(module, sources, classes) == [noun], "a module that only imports it, or has its name in a line"


def test_a_noun_has_one_home(made: dict[str, Any]) -> None:
    twice = [made["Module"]("a.py", "A.", ("field",)), made["Module"]("b.py", "B.", ("field",))]
    with pytest.raises(made["DesignError"], match=r"b\.py.*field.*a\.py"):
        made["noun_table"](twice)


def test_the_floors_on_the_page_are_those_that_are_checked() -> None:
    config = configparser.ConfigParser()
    config.read(ROOT / ".importlinter")
    layers = [line.strip() for line in config["importlinter:contract:companion"]["layers"].strip().splitlines()]
    block = PAGE.read_text(encoding="utf-8").partition("## Who may import whom")[2].partition("```text\n")[2]
    assert block.partition("```")[0].splitlines() == layers
    assert len(layers) <= MOST_FLOORS


def test_only_the_field_step_stands_at_the_root_of_the_companion() -> None:
    assert {path.name for path in (ROOT / "companion").glob("*.py")} == {"__init__.py", "app.py"}


def unmirrored(root: Path) -> list[str]:
    """Folders with modules whose mirror below tests/ has no test file, and folders of tests with nothing to mirror."""
    packages, tests = set(), set()
    for program in ("companion", "sitl"):
        found = (path for path in (root / program).rglob("*.py") if path.name != "__init__.py")
        packages |= {path.parent.relative_to(root) for path in found}
        tests |= {path.parent.relative_to(root / "tests") for path in (root / "tests" / program).rglob("test_*.py")}
    strange = [f"tests/{folder} mirrors no package" for folder in sorted(tests - packages)]
    return [f"no test file in tests/{folder}" for folder in sorted(packages - tests)] + strange


def imported(file: Path) -> set[str]:
    """Full names of all modules that a file imports, and of what it takes from them."""
    names = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return names


def untested(root: Path, package: str) -> list[str]:
    """The modules of a package without a test file of their name in its mirror that imports them."""
    missing = []
    for module in sorted(path.stem for path in (root / "companion" / package).glob("*.py")):
        test, name = Path("tests", "companion", package, f"test_{module}.py"), f"companion.{package}.{module}"
        if module != "__init__" and not ((root / test).is_file() and name in imported(root / test)):
            missing.append(f"{test} must be there and import {name}")
    return missing


def test_the_tests_mirror_the_packages() -> None:
    assert unmirrored(ROOT) == []


@pytest.mark.parametrize("package", ["control", "executive", "operator", "safety", "supervision"])
def test_every_module_that_moves_the_rover_has_a_unit_test_of_its_name_beside_it(package: str) -> None:
    assert untested(ROOT, package) == []


def test_what_has_no_test_beside_it_is_named_in_one_line(tmp_path: Path) -> None:
    for name, text in {
        "companion/a/__init__.py": "",
        "companion/a/one.py": "",
        "companion/a/two.py": "",
        "companion/a/three.py": "",
        "companion/a/deep/four.py": "",
        "tests/companion/a/test_one.py": "from companion.a import one",
        "tests/companion/a/test_two.py": "import companion.a.one",
        "tests/companion/b/test_three.py": "from companion.a.three import nothing",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert untested(tmp_path, "a") == [
        "tests/companion/a/test_three.py must be there and import companion.a.three",
        "tests/companion/a/test_two.py must be there and import companion.a.two",
    ]
    assert unmirrored(tmp_path) == ["no test file in tests/companion/a/deep", "tests/companion/b mirrors no package"]


def test_the_nouns_of_the_concepts_have_a_home(made: dict[str, Any]) -> None:
    homes = {noun for module in made["modules"]() for noun in module.nouns}
    rows = (ROOT / "docs" / "concepts.md").read_text(encoding="utf-8").partition("| noun |")[2].splitlines()[2:]
    nouns = [noun.strip() for row in rows if row.startswith("|") for noun in row.split("|")[1].split(",")]
    assert len(nouns) > 10 and {noun.lower() for noun in nouns} <= {home.lower() for home in homes}


@pytest.mark.parametrize("page", sorted((ROOT / "docs").glob("*.md")), ids=lambda page: page.name)
def test_file_names_alone_are_those_of_files(page: Path) -> None:
    names = {path.name for folder in ("companion", "sitl", "tests", "docs") for path in (ROOT / folder).rglob("*.py")}
    assert set(re.findall(r"`([a-z_0-9]+\.py)`", page.read_text(encoding="utf-8"))) <= names | {"mavlogdump.py"}
