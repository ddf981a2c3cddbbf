"""Writes ``settings.md`` from ``companion/settings/``: ``.venv/bin/python docs/make_settings.py``.

A test compares the page with the models, so neither can change alone.
"""

from __future__ import annotations

from pathlib import Path

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from companion.settings import Settings

PAGE = Path(__file__).with_name("settings.md")

UNITS = {
    "rad_s2": "rad/s²",
    "rad_s": "rad/s",
    "m_s2": "m/s²",
    "m_s": "m/s",
    "deg_s": "deg/s",
    "m": "m",
    "s": "s",
    "hz": "Hz",
    "deg": "deg",
    "fields": "fields",
}
"""Units by the end of a setting's name."""

INTRODUCTION = """# Settings

<!-- Written by docs/make_settings.py from companion/settings/. -->

All settings, with default, unit and range. No file is needed: every setting has a default. To change some, write
them into a TOML file and give it to `run`, `doctor`, `plan`, `bench` or `drive` with `--settings FILE`:

```toml
# settings
profile = "default"         # or "paper"

[guidance]
horizon_m = 6.0

[navigator.thorough]
max_epochs = 80
```

An unknown key is refused, with a similar key that exists or with all keys of that section. A value of the wrong type or
out of range is refused too. `profile = "paper"` searches with the genetic algorithm alone (it sets `navigator.planner`
to `bspline-ga`, unless the file says otherwise); the default profile has graph search behind it, see
[planners.md](planners.md). A `guidance.controller` that plans motions changes a few defaults of `[mapping]` and
`[link]`, see [planned motions](planned-motions.md).
"""


def page() -> str:
    """The whole page."""
    return "\n".join((INTRODUCTION, *_section("", Settings)))


def _section(path: str, model: type[BaseModel]) -> list[str]:
    """The table of one section, then the sections inside it."""
    rows = [_row(name, field) for name, field in model.model_fields.items() if _inside(field) is None]
    lines = []
    if rows:
        lines += [f"## `[{path}]`\n" if path else "## Top level\n"]
        lines += [] if model is Settings else [f"{' '.join((model.__doc__ or '').split())}\n"]
        lines += ["| setting | default | unit | range | meaning |", "|---|---|---|---|---|", *rows, ""]
    for name, field in model.model_fields.items():
        inside = _inside(field)
        if inside is not None:
            lines += _section(f"{path}.{name}".lstrip("."), inside)
    return lines


def _inside(field: FieldInfo) -> type[BaseModel] | None:
    kind = field.annotation
    return kind if isinstance(kind, type) and issubclass(kind, BaseModel) else None


def _row(name: str, field: FieldInfo) -> str:
    meaning = (field.description or "").replace("|", "or")
    return f"| `{name}` | {_value(field.default)} | {_unit(name)} | {_range(field)} | {meaning} |"


def _value(value: object) -> str:
    """The value as in TOML, which has no word for what nobody has set."""
    if value is None:
        return "unset"
    if isinstance(value, bool):
        return f"`{value}`".lower()
    if isinstance(value, tuple):
        return f"`{_plain(value)}`"
    return f'`"{value}"`' if isinstance(value, str) else f"`{value}`"


def _plain(value: object) -> str:
    return f"[{', '.join(_plain(item) for item in value)}]" if isinstance(value, tuple) else str(value)


def _unit(name: str) -> str:
    words = name.split("_")
    return next((UNITS["_".join(words[i:])] for i in range(1, len(words)) if "_".join(words[i:]) in UNITS), "")


def _range(field: FieldInfo) -> str:
    choices = getattr(field.annotation, "__args__", ())
    if choices and all(isinstance(choice, str) for choice in choices):
        return ", ".join(f"`{choice}`" for choice in choices)
    limits = []
    for limit in field.metadata:
        match limit:
            case Ge(least):
                limits.append(f"≥ {least}")
            case Gt(above):
                limits.append(f"> {above}")
            case Le(most):
                limits.append(f"≤ {most}")
            case Lt(below):
                limits.append(f"< {below}")
            case _:
                pass
    return ", ".join(limits)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
