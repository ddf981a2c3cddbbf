"""What is wrong with a value is said without pydantic's own words."""

from __future__ import annotations

from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from companion.mission.tables import Name
from companion.settings import Settings
from companion.storage.validation import describe_first, first_fault


class Part(BaseModel):
    """One key of each kind that files have."""

    model_config = ConfigDict(extra="forbid", strict=True)

    number: float = 0.0
    whole: int = 0
    yes: bool = False
    text: Annotated[str, Field(min_length=2, max_length=3, pattern="^[a-z]*$")] = "ab"
    name: Name = "n"
    share: Annotated[float, Field(ge=0.0, lt=0.5)] = 0.0
    length: Annotated[float, Field(gt=1e-3, le=2.0, allow_inf_nan=False)] = 1.0
    kind: Literal["A", "B"] = "A"
    several: Annotated[list[int], Field(min_length=1, max_length=2)] = [1]
    inside: Annotated[dict[str, int], Field()] = {}


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"number": "x"}, "number: must be a number (got 'x')"),
        ({"whole": 1.5}, "whole: must be a whole number (got 1.5)"),
        ({"yes": 1}, "yes: must be true or false (got 1)"),
        ({"text": 1}, "text: must be a text in quotes (got 1)"),
        ({"text": "a"}, "text: must have 2 or more characters (got 'a')"),
        ({"text": "abcd"}, "text: must have 3 characters or fewer (got 'abcd')"),
        ({"text": "AB"}, "text: must match the pattern '^[a-z]*$' (got 'AB')"),
        ({"name": "a\nb"}, "name: must have no line breaks or other control characters (got 'a\\nb')"),
        ({"share": -1.0}, "share: must be 0 or more (got -1.0)"),
        ({"share": 0.5}, "share: must be less than 0.5 (got 0.5)"),
        ({"length": 0.0}, "length: must be more than 0.001 (got 0.0)"),
        ({"length": 3.0}, "length: must be 2 or less (got 3.0)"),
        ({"length": float("inf")}, "length: must be a finite number (got inf)"),
        ({"kind": "C"}, "kind: must be 'A' or 'B' (got 'C')"),
        ({"several": []}, "several: must have 1 or more values (got [])"),
        ({"several": [1, 2, 3]}, "several: must have 2 values or fewer (got [1, 2, 3])"),
        ({"several": 1}, "several: must be a list in [brackets] (got 1)"),
        ({"inside": 1}, "inside: must be a table, with its keys below a line in [brackets] (got 1)"),
    ],
)
def test_each_kind_of_fault_is_said_in_plain_words(values: dict[str, object], said: str) -> None:
    with pytest.raises(ValidationError) as caught:
        Part.model_validate(values)
    assert describe_first(caught.value, Part) == said
    assert said.startswith(": ".join(first_fault(caught.value))), "the same without what was given"


def test_no_setting_is_refused_in_other_words() -> None:
    wrong = [object(), -1e9, 1e9, 0.5, float("nan"), "", "?", [], [[]], {}, {"?": 1}]
    for section in Settings.model_fields:
        model = type(getattr(Settings(), section))
        for key in getattr(model, "model_fields", {}):
            for value in wrong:
                try:
                    Settings.model_validate({section: {key: value}})
                except ValidationError as error:
                    told = describe_first(error, Settings).lower()
                    assert "input should" not in told and "valid " not in told and "extra inputs" not in told, told
