"""Tests of which ``make test`` takes the first cases, and ``make test-all`` every one."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import Any

import pytest


def first_of(count: int, names: str | Sequence[str], cases: Iterable[Any], **more: Any) -> pytest.MarkDecorator:
    """``pytest.mark.parametrize``, with all cases but the first ``count`` marked as thorough."""
    several = not isinstance(names, str) or "," in names
    return pytest.mark.parametrize(
        names, [_marked(case, several) if i >= count else case for i, case in enumerate(cases)], **more
    )


def _marked(case: Any, several: bool) -> Any:
    thorough = pytest.mark.thorough
    if isinstance(case, type(pytest.param())):
        return pytest.param(*case.values, marks=(*case.marks, thorough), id=case.id)
    return pytest.param(*case, marks=thorough) if several else pytest.param(case, marks=thorough)


def examples(count: int) -> int:
    """How many examples a property is tried with: a third, and all where there is time for them."""
    return count if os.environ.get("ALL_EXAMPLES") else max(1, count // 3)
