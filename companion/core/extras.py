"""Libraries that only some users install: what is missing, what for, and the command that installs it."""

from __future__ import annotations


def not_installed(what: str, extra: str, *libraries: str) -> str:
    """One line. ``what``: the option or command that needs the libraries; ``extra``: of this package, brings them."""
    are, them = ("are", "them") if len(libraries) > 1 else ("is", "it")
    return (
        f"{what}: {', '.join(libraries)} {are} not installed; install {them}: pip install 'rover-companion[{extra}]' "
        f"(in the project's folder: .venv/bin/pip install -e '.[{extra}]')"
    )
