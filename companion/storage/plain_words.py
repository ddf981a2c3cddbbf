"""What is wrong with one value, in plain words: pydantic's own speak of an input and of Python's types."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic_core import ErrorDetails

NUMBER, WHOLE, TABLE = "must be a number", "must be a whole number", "must be a table"
WORDS = {
    "missing": "is missing, and must be given",
    "extra_forbidden": "unknown key",
    "unexpected_keyword_argument": "unknown key",
    "float_type": NUMBER,
    "float_parsing": NUMBER,
    "int_type": WHOLE,
    "int_parsing": WHOLE,
    "int_from_float": WHOLE,
    "finite_number": "must be a finite number",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "string_type": "must be a text in quotes",
    "dict_type": TABLE,
    "model_type": TABLE,
    "model_attributes_type": TABLE,
    "dataclass_type": TABLE,
    "list_type": "must be a list in [brackets]",
    "tuple_type": "must be a list in [brackets]",
    "greater_than": "must be more than {gt}",
    "greater_than_equal": "must be {ge} or more",
    "less_than": "must be less than {lt}",
    "less_than_equal": "must be {le} or less",
    "literal_error": "must be {expected}",
    "enum": "must be {expected}",
    "too_short": "must have {min_length} or more values",
    "too_long": "must have {max_length} values or fewer",
    "string_too_short": "must have {min_length} or more characters",
    "string_too_long": "must have {max_length} characters or fewer",
    "string_pattern_mismatch": "must match the pattern '{pattern}'",
}
"""By pydantic's name of the fault."""


def plain(fault: ErrorDetails) -> str:
    """The reason of a fault, in one line."""
    words = WORDS.get(fault["type"])
    if r"\x00-\x1f" in fault.get("ctx", {}).get("pattern", ""):
        return "must have no line breaks or other control characters"
    if words is not None:
        return words.format(**_whole(fault.get("ctx", {})))
    message = " ".join(fault["msg"].split()).removeprefix("Value error, ")
    return message if fault["type"] == "value_error" else message[:1].lower() + message[1:]


def _whole(bounds: Mapping[str, Any]) -> dict[str, Any]:
    """Bounds without a decimal point that says nothing."""
    return {
        name: int(value) if isinstance(value, float) and value.is_integer() else value for name, value in bounds.items()
    }
