"""What every group of settings is, and what is said of wrong ones."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from pydantic import BaseModel, ConfigDict


def alike(name: str, known: Iterable[str]) -> str:
    """The known name that an unknown one is spelt nearly like; empty if there is none.

    Slips are seldom in the first letter: another one there must be made up for by the rest.
    """
    for near in difflib.get_close_matches(name, known):
        if near[0] == name[0] or difflib.SequenceMatcher(None, near, name).ratio() >= 0.75:
            return near
    return ""


class SettingsError(Exception):
    """A settings file that cannot be used; the text is one line with file, place and reason."""


class Section(BaseModel):
    """A group of settings: immutable, unknown names refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
