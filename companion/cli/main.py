"""Entry point of ``rover-companion``; imports nothing slow before it handles interrupts."""

from __future__ import annotations

from collections.abc import Callable

from companion.cli.entry import start


def main() -> None:
    """Entry point of the ``rover-companion`` script."""
    raise SystemExit(start("rover-companion", _commands))


def _commands() -> Callable[..., object]:
    from companion.cli.commands import app

    return app
