"""Readable in the sun: the contrasts of the page's colours, as WCAG counts them, in light and dark."""

from __future__ import annotations

import re

import pytest

from companion.viewer import film_picture, map_colours
from companion.viewer.server import PAGE

TEXT, LARGE_LINE, DRAWN = 4.5, 7.0, 3.0
THEMES = ("light", "dark")
GROUNDS = ("page", "panel", "raised")
"""Behind texts; the map's are ``free`` and ``unknown``."""
CASED = ("path", "motion", "setpoint", "goal", "rover", "mover", "fence", "done", "failed", "home")
"""Drawn on the map over a wider line of the casing or halo colour."""
TELLS_APART = (("obstacle", "free"), ("obstacle", "unknown"), ("closedLine", "free"))
SIGNS = ("good", "doubt", "failed", "rover")
"""Marks beside texts, and on the timeline."""
Colour = tuple[int, int, int]
SOURCE = (PAGE / "colours.js").read_text(encoding="utf-8")
STYLE = (PAGE / "viewer.css").read_text(encoding="utf-8")
STATES = dict(re.findall(r'(\w+): (\["#\w{6}", "#\w{6}"\])', SOURCE))


def rgb(text: str) -> Colour:
    return int(text[1:3], 16), int(text[3:5], 16), int(text[5:7], 16)


def contrast(one: Colour, other: Colour) -> float:
    """From 1 to 21."""

    def luminance(colour: Colour) -> float:
        shares = [value / 255 for value in colour]
        red, green, blue = (s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in shares)
        return 0.2126 * red + 0.7152 * green + 0.0722 * blue

    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def mixed(over: Colour, under: Colour, share: float) -> Colour:
    red, green, blue = (round(share * a + (1.0 - share) * b) for a, b in zip(over, under, strict=True))
    return red, green, blue


def block(head: str) -> str:
    return SOURCE.partition(head)[2].partition("}")[0]


def colours(theme: str) -> dict[str, Colour]:
    """The theme's plain colours, levels and lists by name."""
    own, levels = block(f"const {theme.upper()} = {{"), block(f"  {theme}: {{")
    found = {name: rgb(value) for name, value in re.findall(r'(\w+): "(#\w{6})"', own + levels)}
    for name, values in re.findall(r"(\w+): \[(.*?)\]", own):
        found |= {f"{name[:-1]}-{i}": rgb(value) for i, value in enumerate(re.findall(r"#\w{6}", values))}
    assert {*GROUNDS, *CASED, *SIGNS, "speed-4", "other-4"} <= set(found)
    return found


@pytest.mark.parametrize("theme", THEMES)
def test_texts_can_be_read_on_each_ground(theme: str) -> None:
    known = colours(theme)
    used = {name for name in re.findall(r"[^-]color: var\(--([\w-]+)\)", STYLE) if not name.startswith("state-")}
    assert {"text", "soft", "error", "warning", "notice", "good"} <= used
    signs = {"rover", *(name for name in used if name.startswith("other-"))}  # the rover's is a sign in the panel
    bad = {
        (name, ground): round(contrast(known[name], known[ground]), 2)
        for name in used - signs - {"page"}
        for ground in GROUNDS
        if contrast(known[name], known[ground]) < TEXT
    }
    assert bad == {}
    assert contrast(known["page"], known["accent"]) >= TEXT, "on buttons that are pressed"
    assert contrast(known["rover"], known["panel"]) >= TEXT and contrast(known["goalText"], known["goal"]) >= TEXT
    assert contrast(known["ink"], known["halo"]) >= TEXT, "names on the map"
    assert all(contrast(known[name], known["halo"]) >= TEXT for name in ("mover", "failed")), "names on the map"


def test_the_large_line_can_be_read_from_afar() -> None:
    assert set(STATES) == {"driving", "waiting", "stopped", "ended", "connecting", "offline"}
    for pair in STATES.values():
        ground, text = map(rgb, re.findall(r"#\w{6}", pair))
        assert contrast(ground, text) >= LARGE_LINE, pair
    faint = re.search(r"\.clock \{\s*opacity: ([\d.]+)", STYLE)
    assert faint is not None
    for name in ("ended", "offline"):  # what it stands on when what is shown is old
        ground, text = map(rgb, re.findall(r"#\w{6}", STATES[name]))
        assert contrast(mixed(text, ground, float(faint[1])), ground) >= TEXT, name


@pytest.mark.parametrize("theme", THEMES)
def test_what_is_drawn_on_the_map_stands_out(theme: str) -> None:
    """A line from the ground, or from the casing that it has below it on any ground."""
    known = colours(theme)
    for ground in ("free", "unknown", "obstacle"):
        casing = mixed(known["halo"], known[ground], 0.9)
        for name in (*CASED, *(name for name in known if name.startswith(("speed-", "other-")))):
            best = max(contrast(known[name], known[ground]), contrast(known[name], casing))
            assert best >= DRAWN, (name, ground, round(best, 2))
    bad = [pair for pair in TELLS_APART if contrast(known[pair[0]], known[pair[1]]) < DRAWN]
    assert bad == [] and all(contrast(known[name], known["panel"]) >= DRAWN for name in SIGNS)


def test_films_have_the_colours_of_the_page() -> None:
    light = colours("light")
    assert tuple(light[name] for name in ("rover", "path", "fence")) == (
        film_picture.ROVER,
        film_picture.PATH,
        film_picture.BORDER,
    )
    cells = [tuple(int(value) for value in cell) for cell in map_colours.CELL_COLOURS]
    assert cells == [light[name] for name in ("unknown", "free", "obstacle", "closed", "costly")]
    for name, pair in film_picture.STATES.items():
        assert list(pair) == [rgb(value) for value in re.findall(r"#\w{6}", STATES[name])], name
