"""A film of a drive, made of a report: as an animated GIF, or with ffmpeg as MP4.

Nouns: film.
"""

from __future__ import annotations

import errno
import math
import os
import shutil
import subprocess
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from PIL import Image

from companion.viewer.film_picture import FIXED, FilmPicture, section_of

MOST_PICTURES = 300
"""A longer drive leaves out moments."""
PICTURE_MS = 80
LAST_MS = 1600
"""The last picture stays so long."""
BEFORE_S = 2.0
"""So much before the rover is first driven the film begins."""
COLOURS = 96
CUT = "the record was cut short here"
"""What a film of such a record says at its end: the rover may have gone on."""
FFMPEG = "ffmpeg"
Json = dict[str, Any]


class FilmError(Exception):
    """The film cannot be made; the text is one line with the remedy."""


def check_ffmpeg() -> None:
    """Raises FilmError if ffmpeg is not installed."""
    if shutil.which(FFMPEG) is None:
        raise FilmError("--mp4: ffmpeg is not installed; install it (apt-get install ffmpeg), or use --gif")


class Film:
    """The pictures of one report (``companion/viewer/report_data.py``)."""

    def __init__(self, data: Json) -> None:
        """Raises FilmError if the mission had not begun."""
        self._data = data
        frames = _filled(data["frames"])
        if not data["scene"].get("map") or not any(frame["pose"] for frame in frames):
            raise FilmError("--gif and --mp4: the mission had not begun, there is no map to show")
        drives = next((frame["t"] for frame in frames if frame["state"] == "driving"), frames[-1]["t"])
        self._frames = [frame for frame in frames if frame["t"] >= drives - BEFORE_S]
        if data["scene"]["cut"]:
            self._frames.append({**self._frames[-1], "state": "cut", "line": CUT, "speed": None})
        places = [(frame["t"], frame["pose"][:2]) for frame in frames if frame["pose"]]
        shown = [place for _, place in places] + [one["place"] for one in data["scene"]["targets"]]
        section = section_of(data["scene"], shown)
        self._track = _thinned(places, data["scene"]["map"]["cell_m"] / section.scale)
        self._picture = FilmPicture(data["scene"], section)

    @property
    def size(self) -> tuple[int, int]:
        """Of each picture."""
        return self._picture.size

    def moments(self) -> list[Json]:
        """The frames that are shown, at most MOST_PICTURES, evenly spread, with the first and the last."""
        last, count = len(self._frames) - 1, min(len(self._frames), MOST_PICTURES)
        return [self._frames[round(number * last / max(count - 1, 1))] for number in range(count)]

    def pictures(self) -> Iterator[Image.Image]:
        """A picture for each moment. To be asked for once."""
        maps, tiles = deque(self._data.get("maps", ())), deque(self._data["tiles"])
        for frame in self.moments():
            while due := [one for one in (maps, tiles) if one and one[0][0] <= frame["t"]]:
                first = min(due, key=lambda one: one[0][0])  # a map begins before its tiles
                _, told = first.popleft()
                self._picture.begin_map(told) if first is maps else self._picture.take_tiles(told)
            track = [place for t, place in self._track if t <= frame["t"]]
            contacts = [one for one in self._data["contacts"] if one["t"] <= frame["t"]]
            yield self._picture.drawn(frame, track, contacts)


Placed = tuple[float, list[float]]
"""A time, and a place [north, east]."""


def _thinned(places: list[Placed], spacing_m: float) -> list[Placed]:
    """Places that lie apart from each other: standing for an hour adds nothing to a track."""
    kept = places[:1]
    for t, place in places[1:]:
        if math.dist(place, kept[-1][1]) >= spacing_m:
            kept.append((t, place))
    return kept


def write_gif(film: Film, file: Path) -> None:
    """An animated GIF that begins again at its end. Raises OSError."""
    pictures = list(film.pictures())
    palette = _palette(pictures[-1])
    first, *rest = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in pictures]
    times_ms = [PICTURE_MS] * len(rest) + [LAST_MS]
    first.save(file, "GIF", save_all=True, append_images=rest, duration=times_ms, loop=0, optimize=False)


def _palette(picture: Image.Image) -> Image.Image:
    """One palette for all pictures: colours do not flicker, and what stays the same takes no room."""
    fixed = [value for colour in FIXED for value in colour]
    found = picture.quantize(COLOURS, Image.Quantize.MEDIANCUT).getpalette() or []
    palette = Image.new("P", (1, 1))
    palette.putpalette(fixed + found[: 3 * COLOURS])
    return palette


FULL = os.strerror(errno.ENOSPC)


def write_mp4(film: Film, file: Path) -> None:
    """H.264 in MP4, by ffmpeg. Raises FilmError if ffmpeg gives up, OSError if the file cannot be written."""
    width, height = film.size
    command = [
        FFMPEG, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}",
        "-r", f"1000/{PICTURE_MS}", "-i", "pipe:0", "-c:v", "libx264", "-threads", "1", "-pix_fmt", "yuv420p",
        "-movflags", "+faststart", "-fflags", "+bitexact", "-flags:v", "+bitexact", "-f", "mp4",
        f"file:{file.resolve()}",
    ]  # fmt: skip
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as child:
        assert child.stdin is not None and child.stderr is not None
        try:
            last = b""
            for picture in film.pictures():
                last = picture.tobytes()
                child.stdin.write(last)
            for _ in range(LAST_MS // PICTURE_MS):
                child.stdin.write(last)
            child.stdin.close()
        except BrokenPipeError:
            pass  # what ffmpeg says of it follows
        said = child.stderr.read().decode(errors="replace").strip()
    if FULL in said:
        raise OSError(errno.ENOSPC, FULL)
    # It may say that a file could not be ended, and end well itself.
    if child.returncode != 0 or said or not file.exists():
        reason = said.splitlines()[-1] if said else f"exit code {child.returncode}"
        raise FilmError(f"--mp4: ffmpeg gave up: {reason}; use --gif")


def _filled(frames: list[Json]) -> list[Json]:
    """Frames with what has not changed since the one before."""
    whole: list[Json] = []
    for frame in frames:
        whole.append({**(whole[-1] if whole else {}), **frame})
    return whole
