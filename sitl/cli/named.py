"""Options that take several names."""

from __future__ import annotations


def names_in(listed: str) -> tuple[str, ...]:
    """The names of a list separated by commas; blanks round a name do not count, nor do empty ones."""
    return tuple(name.strip() for name in listed.split(",") if name.strip())
