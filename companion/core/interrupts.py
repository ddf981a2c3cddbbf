"""Whether an error is Ctrl-C: an interrupt inside a compiled loop comes out as one SystemError, or as several."""

from __future__ import annotations


def is_interrupt(error: BaseException | None) -> bool:
    """Whether a KeyboardInterrupt is behind this error, however many others lie between."""
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        if isinstance(error, KeyboardInterrupt):
            return True
        seen.add(id(error))
        error = error.__cause__ or error.__context__
    return False
