"""Planners from other packages: by ``module:name``, or registered as an entry point of ``rover_companion.planners``.

Nouns: own planner.
"""

from __future__ import annotations

import importlib
import sys
from importlib.metadata import entry_points
from pathlib import Path

from companion.planning.planner import PlannerFactory

GROUP = "rover_companion.planners"


class OwnPlannerError(ValueError):
    """A planner of one's own that cannot be loaded; the text is one line."""


def registered() -> tuple[str, ...]:
    """The names that installed packages have registered."""
    return tuple(sorted({one.name for one in entry_points(group=GROUP)}))


def own_factory(name: str) -> PlannerFactory | None:
    """What makes the planner, called with the planner settings; None for a name that is neither form.

    ``module:name`` is looked for beside the installed packages in the present folder, too. Raises OwnPlannerError.
    """
    try:
        if ":" in name:
            module, _, attribute = name.partition(":")
            found = getattr(_imported(module), attribute)
        else:
            points = tuple(entry_points(group=GROUP, name=name))
            if not points:
                return None
            found = points[0].load()
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise OwnPlannerError(f"planner {name!r:.80} cannot be loaded: {reason:.200}") from error
    if not callable(found):
        raise OwnPlannerError(f"planner {name!r:.80} is no class or function that makes a planner")
    factory: PlannerFactory = found
    return factory


def source_of(name: str) -> Path | None:
    """The file that an own planner comes from, for those who must know when it changes; None for others."""
    factory = own_factory(name)
    if factory is None:
        return None
    module = name.partition(":")[0] if ":" in name else getattr(factory, "__module__", "")
    file = getattr(sys.modules.get(module), "__file__", None)
    return None if file is None else Path(file)


def _imported(module: str) -> object:
    """The module; the present folder comes last, and only while it is imported."""
    before = list(sys.path)
    sys.path.append(str(Path.cwd()))
    try:
        return importlib.import_module(module)
    finally:
        sys.path[:] = before
