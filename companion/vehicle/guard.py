"""The guard: a script on the autopilot that stops the rover when the companion falls silent.

A velocity told to ArduRover lasts three seconds, or GUID_TIMEOUT. With the script it lasts for a fraction of one, and
the companion may tell higher speeds near obstacles. ``guard.lua`` is the script itself.

Nouns: guard.
"""

from __future__ import annotations

from importlib.resources import files

NAME = "CMPGRD"
"""NAMED_VALUE_FLOAT of the script, with the id of the component that it watches behind it: how many milliseconds it
waits, negative while the present HOLD is its doing."""
FRESH_S = 1.3
"""It speaks twice a second; without a word for so long it is not there."""
IN_TIME_S = 0.95
"""With a guard that waits longer the rover is driven as without one."""
FILE = "companion_guard.lua"
COMPONENT = 191


def name_of(component_id: int) -> str:
    """The name under which a guard that watches this component speaks."""
    return f"{NAME}{component_id}"


def script(component_id: int = COMPONENT) -> str:
    """The Lua script, for a companion with this component id."""
    text = files("companion.vehicle").joinpath("guard.lua").read_text(encoding="utf-8")
    return text.replace(f"local COMPANION = {COMPONENT}\n", f"local COMPANION = {component_id}\n")
