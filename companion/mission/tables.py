"""What the tables of mission and world files share: strict keys, and the kinds of numbers in them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

T = TypeVar("T")


def swapped_hint(lat_deg: float, lon_deg: float) -> str:
    """What to add to the refusal of a latitude and longitude that cannot be; empty if they are no better swapped."""
    return "; latitude and longitude seem swapped" if 180.0 >= abs(lat_deg) > 90.0 >= abs(lon_deg) else ""


def refuse_swapped(lat_deg: object, lon_deg: object) -> None:
    """Raises ValueError where only the other way round these could be a latitude and a longitude."""
    if isinstance(lat_deg, int | float) and isinstance(lon_deg, int | float) and swapped_hint(lat_deg, lon_deg):
        hint = swapped_hint(lat_deg, lon_deg)
        raise ValueError(f"{lat_deg}, {lon_deg} is not a latitude and longitude{hint}")


def _not_swapped(pair: object) -> object:
    if isinstance(pair, list | tuple) and len(pair) == 2:
        refuse_swapped(*pair)
    return pair


Metres = Annotated[float, Field(ge=-1e6, le=1e6)]
Index = Annotated[int, Field(ge=-1_000_000, le=1_000_000)]
Pair = Annotated[tuple[Metres, Metres], Field(strict=False)]
Field2 = Annotated[tuple[Index, Index], Field(strict=False)]
Lat = Annotated[float, Field(ge=-90.0, le=90.0)]
Lon = Annotated[float, Field(ge=-180.0, le=180.0)]
LatLon = Annotated[tuple[Lat, Lon], Field(strict=False), BeforeValidator(_not_swapped)]
Positive = Annotated[float, Field(gt=0.0, le=1e6)]
Name = Annotated[str, Field(min_length=1, max_length=100, pattern=r"^[^\x00-\x1f\x7f\u2028\u2029\x85]+$")]
FileName = Annotated[str, Field(min_length=1, max_length=1000, pattern=r"^[^\x00-\x1f\x7f]+$")]


class Table(BaseModel):
    """A TOML table: unknown keys, wrong types, inf and nan are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def named(path: Path, kind: str, number: int, make: Callable[[], T], error: type[Exception]) -> T:
    """The result of ``make``; its ValueError becomes ``error`` with file, kind of table and number from 1."""
    try:
        return make()
    except ValueError as fault:
        raise error(f"{path}: {kind} {number}: {fault}") from None
