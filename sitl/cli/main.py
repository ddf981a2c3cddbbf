"""Entry point of ``rover-sitl``; heavy modules are imported only after the start."""

from __future__ import annotations

from collections.abc import Callable

from companion.cli.entry import start


def main() -> None:
    """Entry point of the ``rover-sitl`` script."""
    raise SystemExit(start("rover-sitl", _commands))


def _commands() -> Callable[..., object]:
    from sitl.cli.commands import app

    return app
