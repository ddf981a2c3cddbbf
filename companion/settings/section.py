"""The base class of all groups of settings, and the error for a settings file that cannot be used."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class SettingsError(Exception):
    """A settings file that cannot be used; the text is one line with file, place and reason."""


class Section(BaseModel):
    """A group of settings: immutable; unknown names and values of another type are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
