"""Entry point of ``rover-sitl``; heavy modules are imported only after the start."""

from __future__ import annotations

import sys
from collections.abc import Callable


def main() -> None:
    """Entry point of the ``rover-sitl`` script."""
    try:
        from companion.cli.entry import start
    except KeyboardInterrupt:
        print("rover-sitl: stopped by Ctrl-C", file=sys.stderr)
        raise SystemExit(130) from None
    raise SystemExit(start("rover-sitl", _commands))


def _commands() -> Callable[..., object]:
    from sitl.cli.commands import app

    return app
