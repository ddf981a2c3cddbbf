"""Writes the table of parameters in docs/first-drive.md from the code: ``python docs/make_parameters.py``."""

from __future__ import annotations

import re
from pathlib import Path

from companion.mission.mission import RoverSpec
from companion.vehicle.wanted_parameters import Use, wanted_parameters

PAGE = Path(__file__).resolve().parent / "first-drive.md"
BEGIN, END = "<!-- begin parameters -->", "<!-- end parameters -->"


def table() -> str:
    """The table as Markdown."""
    lines = ["| parameter | wanted | why |", "|---|---|---|"]
    for one in wanted_parameters(RoverSpec().cruise_speed_m_s):
        use = "" if one.use is Use.ALWAYS else f"; only {one.use}"
        wish = "the mission's speed or more" if one.name == "WP_SPEED" else one.wish
        lines.append(f"| `{one.name}` | {wish} | {one.why}{use} |")
    return "\n".join(lines)


def page() -> str:
    """The page with the table in it."""
    text = PAGE.read_text(encoding="utf-8")
    return re.sub(f"{BEGIN}.*?{END}", lambda _: f"{BEGIN}\n{table()}\n{END}", text, flags=re.DOTALL)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
