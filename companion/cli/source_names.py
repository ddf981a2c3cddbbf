"""The names in a Python file: which each definition at its top level uses, and which are imported.

Reading them takes a second for all files with kernels, at every start; so they are kept, one small file for each.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import json
import os
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple, Self

RULES = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()
"""What was found by other rules than those of this file is not used."""


class SourceNames(NamedTuple):
    """The names at the top level of a file."""

    decorated: frozenset[str]
    """Functions with a decorator: kernels are among them."""
    uses: dict[str, set[str]]
    """The names in each definition; ``name.attribute`` for an attribute."""
    imports: tuple[tuple[str, str, str], ...]
    """Name here, module, and name there: "*" for a module that is imported whole."""

    @classmethod
    def of(cls, text: bytes) -> Self:
        """Those of a file with this text."""
        tree = ast.parse(text)
        decorated, uses = set(), defaultdict[str, set[str]](set)
        for statement in _statements(tree):
            read, stored = _names_in(statement)
            if isinstance(statement, ast.FunctionDef | ast.ClassDef):
                uses[statement.name] |= read | stored
                if isinstance(statement, ast.FunctionDef) and statement.decorator_list:
                    decorated.add(statement.name)
            else:
                for name in stored or read:  # a statement that stores none changes a value in place
                    uses[name.partition(".")[0]] |= read | stored
        return cls(frozenset(decorated), dict(uses), tuple(_imports(tree)))

    @classmethod
    def kept(cls, text: bytes, place: Path, name: str) -> Self:
        """The same, read from ``place`` if this file's names were found before, and kept there if not."""
        digest = hashlib.sha256(RULES.encode() + text).hexdigest()[:16]
        path = place / f"{name}-{digest}.json"
        with contextlib.suppress(OSError, ValueError, TypeError, KeyError):
            found = json.loads(path.read_bytes())
            uses = {key: set(names) for key, names in found["uses"].items()}
            return cls(frozenset(found["decorated"]), uses, tuple((a, b, c) for a, b, c in found["imports"]))
        names = cls.of(text)
        with contextlib.suppress(OSError):  # a cache that cannot be written
            place.mkdir(parents=True, exist_ok=True)
            for old in place.glob(f"{name}-*.json"):
                old.unlink(missing_ok=True)
            whole = place / f".{path.name}.{os.getpid()}"
            whole.write_text(json.dumps(names._asdict(), default=sorted))
            whole.replace(path)
        return names


def _statements(tree: ast.AST) -> list[ast.stmt]:
    """Those at the top level, also inside ``if``, ``try`` and the like."""
    found: list[ast.stmt] = []
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If | ast.Try | ast.With | ast.For | ast.ExceptHandler):
            found += _statements(node)
        if isinstance(node, ast.stmt):
            found.append(node)
    return found


def _names_in(statement: ast.stmt) -> tuple[set[str], set[str]]:
    """The names it reads and those it stores, those of argument types too.

    A kernel's code depends on the fields of a named tuple that is the type of an argument.
    """
    nodes = list(ast.walk(statement))
    attributes = {id(node.value): node.attr for node in nodes if isinstance(node, ast.Attribute)}
    read, stored = set(), set()
    for node in nodes:
        if isinstance(node, ast.Name):
            if isinstance(node.ctx, ast.Store):
                stored.add(node.id)
            read.add(f"{node.id}.{attributes[id(node)]}" if id(node) in attributes else node.id)
    return read, stored


def _imports(tree: ast.Module) -> list[tuple[str, str, str]]:
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            found += [(alias.asname or alias.name, node.module, alias.name) for alias in node.names]
        elif isinstance(node, ast.Import):
            found += [(alias.asname or alias.name.partition(".")[0], alias.name, "*") for alias in node.names]
    return found
