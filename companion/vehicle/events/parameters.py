"""What ground stations want of the companion's own parameters."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ParametersAsked:
    """PARAM_REQUEST_LIST: all of them."""

    time_s: float


@dataclass(frozen=True, slots=True)
class ParameterAsked:
    """PARAM_REQUEST_READ: one, by its place in the list, or by name where ``index`` is negative."""

    time_s: float
    name: str
    index: int


@dataclass(frozen=True, slots=True)
class ParameterChangeAsked:
    """PARAM_SET. ``to_us``: said to the companion by its component id, not to everybody."""

    time_s: float
    name: str
    value: float
    to_us: bool


ParameterRequest = ParametersAsked | ParameterAsked | ParameterChangeAsked
