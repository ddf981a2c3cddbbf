"""A mission as JSON and back, without loss, whatever kind of file it came from."""

from __future__ import annotations

import functools

from pydantic import TypeAdapter, ValidationError

from companion.mission.mission import Mission, MissionError
from companion.storage.validation import first_fault


def to_json(mission: Mission) -> str:
    """The mission as JSON; ``from_json`` gives an equal mission."""
    return _adapter().dump_json(mission, indent=1).decode() + "\n"


def from_json(text: str | bytes, source: str) -> Mission:
    """A mission from its JSON. Raises MissionError: one line that names ``source``."""
    try:
        return _adapter().validate_json(text)
    except ValidationError as error:
        place, reason = first_fault(error)
        raise MissionError(f"{source}: {place}: {reason}") from error


@functools.cache
def _adapter() -> TypeAdapter[Mission]:
    return TypeAdapter(Mission)
