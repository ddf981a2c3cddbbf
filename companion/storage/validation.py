"""What pydantic finds wrong with data, in one line."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from typing import get_args

from pydantic import BaseModel, ValidationError

from companion.storage.plain_words import TABLE, plain

MOST_OTHERS = 3
"""So many places are named beside the first fault."""
NUMBER = r"[+-]?[\d_]+([.,]\d+)?"
QUOTED = {"float_type": NUMBER, "int_type": r"[+-]?\d+", "bool_type": "true|false"}
"""What people put in quotes where it needs none."""


def first_fault(error: ValidationError) -> tuple[str, str]:
    """Place and reason of the first fault of a validation."""
    fault = error.errors(include_url=False)[0]
    return ".".join(str(key) for key in fault["loc"]) or "file", plain(fault)


def describe_first(error: ValidationError, model: type[BaseModel]) -> str:
    """The first fault of a validation in one line: place and reason, and the places of the next ones.

    For an unknown key, also the nearest known key, or all.
    """
    others = _other_places(error, model)
    more = f", and {len(others) - MOST_OTHERS} more" if len(others) > MOST_OTHERS else ""
    also = f" (also wrong: {', '.join(others[:MOST_OTHERS])}{more})" if others else ""
    # Quoted keys may hold any character.
    return "".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in _described(error, model) + also)


def _other_places(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """Where else something is wrong, tables counted from 1. What pydantic tried in turn for one value is one place."""
    places = [_place(fault["loc"], model) for fault in error.errors(include_url=False)]
    return [place for place in dict.fromkeys(places) if place and place != places[0]]


def _place(keys: tuple[int | str, ...], model: type[BaseModel]) -> str:
    """The keys as far as they are those of the file: behind them may stand kinds of values."""
    text = ""
    for at, key in enumerate(keys):
        if isinstance(key, int):
            text += f" {key + 1}"
            continue
        text += f".{key}" if text else key
        if key not in _known_keys(model, keys[:at]) or not _has_tables(model, keys[: at + 1]):
            break
    return text


def alike(name: str, known: Iterable[str]) -> str:
    """The known name with nearly the same spelling as ``name``; empty if there is none.

    The first letter is rarely wrong: if it differs, the rest must match better.
    """
    for near in difflib.get_close_matches(name, known):
        if near[0] == name[0] or difflib.SequenceMatcher(None, near, name).ratio() >= 0.75:
            return near
    return ""


def quoted_hint(value: object, wanted: str = NUMBER) -> str:
    """What to add to the refusal of what stands in quotes and should not; empty for anything but ``wanted``."""
    if not isinstance(value, str) or not re.fullmatch(wanted, value.strip()):
        return ""
    return f"; write {value.strip().replace(',', '.')} without quotes"


def number_hint(text: object) -> str:
    """What to add to the refusal of a text that stands where a number should; empty if it is no number either."""
    if isinstance(text, str) and re.fullmatch(r"[+-]?\d+,\d+", text):
        return f"; write {text.replace(',', '.')} with a point"
    return ""


def _described(error: ValidationError, model: type[BaseModel]) -> str:
    place, reason = first_fault(error)
    fault = error.errors(include_url=False)[0]
    if fault["type"] in ("missing", "value_error"):
        return f"{place}: {reason}"
    if fault["type"] in ("list_type", "tuple_type") and isinstance(fault.get("input"), dict):
        name = ".".join(key for key in fault["loc"] if isinstance(key, str))
        return f"{place}: one table where several may stand; write [[{name}]] with double brackets"
    if reason == TABLE:
        return f"{place}: {TABLE}, with its keys below a line in [brackets] (got {fault.get('input')!r:.60})"
    if fault["type"] == "too_long" and fault["ctx"]["field_type"] == "Tuple":  # [18,0, 3]: its comma is a new value
        wanted, given = fault["ctx"]["max_length"], fault.get("input")
        return f"{place}: {wanted} values are wanted (got {given!r:.60}); decimals have a point, 18.0 and not 18,0"
    if fault["type"] != "extra_forbidden":
        unquoted = QUOTED.get(fault["type"])
        hint = quoted_hint(fault.get("input"), unquoted) if unquoted else ""
        return f"{place}: {reason} (got {fault.get('input')!r:.60}){hint}"
    known = _known_keys(model, fault["loc"][:-1])
    near = alike(str(fault["loc"][-1]), known)
    hint = f", did you mean '{near}'?" if near else f"; known here: {', '.join(known)}"
    sections = [] if len(fault["loc"]) > 1 else _sections_with(model, str(fault["loc"][0]))
    return f"{place}: unknown key{f'; it stands below [{sections[0]}]' if len(sections) == 1 else hint}"


def _sections_with(model: type[BaseModel], key: str) -> list[str]:
    """The tables of the file that have this key."""
    return [name for name in model.model_fields if key in _known_keys(model, (name,)) and key != name]


def _known_keys(model: type[BaseModel], place: tuple[int | str, ...]) -> list[str]:
    """The keys of the model at a place; looks through lists and optional values."""
    return list(_model_at(model, place).model_fields)


def _has_tables(model: type[BaseModel], place: tuple[int | str, ...]) -> bool:
    """Whether tables stand at a place, which is no kind of value but one more table or more."""
    return _model_at(model, place) is not _model_at(model, place[:-1])


def _model_at(model: type[BaseModel], place: tuple[int | str, ...]) -> type[BaseModel]:
    for key in place:
        field = model.model_fields.get(str(key))
        if field is not None:
            inside = (field.annotation, *get_args(field.annotation))
            model = next((kind for kind in inside if isinstance(kind, type) and issubclass(kind, BaseModel)), model)
    return model
