"""Entry point of ``rover-companion``; imports nothing slow before it handles interrupts."""

from __future__ import annotations

import sys
from collections.abc import Callable


def main() -> None:
    """Entry point of the ``rover-companion`` script."""
    try:
        from companion.cli.entry import start
    except KeyboardInterrupt:
        print("rover-companion: stopped by Ctrl-C", file=sys.stderr)
        raise SystemExit(130) from None
    raise SystemExit(start("rover-companion", _commands))


def _commands() -> Callable[..., object]:
    from companion.cli.commands import app

    return app
