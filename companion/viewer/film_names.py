"""Film names: where the names of targets stand on a picture: short, above their mark or below, and none upon another.

Nouns: film name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

MOST_LETTERS = 28
BESIDE, HALF_HIGH, EDGE = 16.0, 8.0, 14.0
"""Pixels between mark and name, of half a name's height, and between a name's middle and the edge of the picture."""


@dataclass(frozen=True, slots=True)
class FilmName:
    """A text, the pixel of its middle, and half its width."""

    text: str
    x: float
    y: float
    half: float

    def meets(self, other: FilmName) -> bool:
        """Whether one lies upon the other."""
        return abs(self.x - other.x) < self.half + other.half and abs(self.y - other.y) < 2.0 * HALF_HIGH


def film_names(
    targets: Iterable[tuple[str, float, float]], width_of: Callable[[str], float], size: tuple[int, int]
) -> list[FilmName]:
    """``targets``: names with pixels; the first choose first. A name for which there is no room is left out."""
    placed: list[FilmName] = []
    for name, x, y in targets:
        text = shortened(name)
        half = width_of(text) / 2.0 + 3.0
        inside = min(max(x, half), size[0] - half)
        spots = [FilmName(text, inside, at, half) for at in (y - BESIDE, y + BESIDE) if EDGE < at < size[1] - EDGE]
        placed += [spot for spot in spots if not any(spot.meets(other) for other in placed)][:1]
    return placed


def shortened(name: str) -> str:
    """A long name without its middle: its end may be what tells it from others."""
    if len(name) <= MOST_LETTERS:
        return name
    end = MOST_LETTERS // 3
    return f"{name[: MOST_LETTERS - end - 3].rstrip()}...{name[-end:].lstrip()}"
