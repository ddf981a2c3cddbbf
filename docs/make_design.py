"""Writes layout and nouns of ``design.md`` from the modules' docstrings: ``.venv/bin/python docs/make_design.py``.

A module says what is in it in the first sentence of its docstring. The last paragraph of the docstring, ``Nouns: one,
another.``, lists the nouns whose home it is. A test compares the page with the modules, so neither can change alone.
"""

from __future__ import annotations

import ast
import functools
import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

PAGE = Path(__file__).with_name("design.md")
ROOT = PAGE.parents[1]
PACKAGES = ("companion", "sitl")
WIDTH = 120
COLUMN = 30
"""Where the sentences begin: a tree of three floors with the longest name of a module fits before it."""
NOUNS = re.compile(r"\n\nNouns: (.+?)\.\s*\Z", re.DOTALL)


class DesignError(Exception):
    """A module that cannot be placed on the page; one line with its path."""


@dataclass(frozen=True)
class Module:
    """A module or a package. ``path``: relative to the root; ``says``: the first sentence of its docstring."""

    path: str
    says: str
    nouns: tuple[str, ...]


@functools.cache
def modules(root: Path = ROOT) -> tuple[Module, ...]:
    """All modules of both programs, packages before what is in them, ordered by path. Raises DesignError."""
    found = []
    for package in PACKAGES:
        files = sorted((root / package).rglob("*.py"), key=lambda file: (file.parent, file.name != "__init__.py", file))
        found += [_module(file, root) for file in files if file.name != "__init__.py" or file.parent != root / package]
    return tuple(found)


def _module(file: Path, root: Path) -> Module:
    path = str(file.relative_to(root)).removesuffix("__init__.py")
    docstring = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    says = " ".join(docstring.partition("\n\n")[0].split())
    if not says.endswith((".", "?")):
        raise DesignError(f"{path}: the first paragraph of its docstring is no sentence")
    nouns = NOUNS.search(docstring)
    return Module(path, says, tuple(" ".join(noun.split()) for noun in nouns[1].split(",")) if nouns else ())


def layout(found: Sequence[Module]) -> str:
    """The tree with what each module says."""
    lines = []
    for package in PACKAGES:
        lines.append(f"{package}/")
        mine = [module for module in found if module.path.startswith(f"{package}/")]
        # A package's own files come first, so that what stands at the root is seen at once.
        for module in sorted(mine, key=lambda module: _order(module.path)):
            parts = module.path.rstrip("/").split("/")
            name = "  " * (len(parts) - 1) + parts[-1] + ("/" if module.path.endswith("/") else "")
            lines += textwrap.wrap(
                f"{name:{COLUMN - 1}} {module.says}",
                WIDTH,
                subsequent_indent=" " * COLUMN,
                drop_whitespace=True,
                break_on_hyphens=False,
            )
    return "\n".join(["```text", *lines, "```"])


def _order(path: str) -> list[tuple[bool, str]]:
    """Within a package its modules before the packages in it."""
    parts = path.rstrip("/").split("/")
    is_package = path.endswith("/")
    return [(i < len(parts) - 1 or is_package, part) for i, part in enumerate(parts)]


def noun_table(found: Sequence[Module]) -> str:
    """Every noun and its home, by the alphabet. Raises DesignError for a noun with two homes."""
    homes: dict[str, str] = {}
    for module in found:
        for noun in module.nouns:
            if noun in homes:
                raise DesignError(f"{module.path}: the noun {noun!r} has another home: {homes[noun]}")
            homes[noun] = module.path
    rows = [f"| {noun} | `{homes[noun]}` |" for noun in sorted(homes, key=str.lower)]
    return "\n".join(["| noun | home |", "|---|---|", *rows])


def page(text: str, root: Path = ROOT) -> str:
    """The page with its generated parts as the modules are now. Raises DesignError."""
    found = modules(root)
    for name, part in (("layout", layout(found)), ("nouns", noun_table(found))):
        begin, end = f"<!-- begin {name} -->\n", f"<!-- end {name} -->"
        head, marker, rest = text.partition(begin)
        _, closing, tail = rest.partition(end)
        if not marker or not closing:
            raise DesignError(f"{PAGE.name}: no place for the {name}")
        text = f"{head}{begin}\n{part}\n\n{closing}{tail}"
    return text


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
