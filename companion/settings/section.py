"""The base class of all groups of settings, and the error for a settings file that cannot be used."""

from __future__ import annotations

from typing import Self

from pydantic import BaseModel, ConfigDict, model_validator

MOST = 2**31 - 1
"""The compiled kernels take no larger whole numbers."""


class SettingsError(Exception):
    """A settings file that cannot be used; the text is one line with file, place and reason."""


class Section(BaseModel):
    """A group of settings: immutable; unknown names and values of another type are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @model_validator(mode="after")
    def _whole_numbers_fit(self) -> Self:
        for name, value in self:
            if isinstance(value, int) and abs(value) > MOST:
                raise ValueError(f"{name} should be at most {MOST} (got {value})")
        return self
