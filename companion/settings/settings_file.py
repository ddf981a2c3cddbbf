"""Settings read from a TOML file, and what is said of one that is wrong."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import get_args

from pydantic import BaseModel, ValidationError

from companion.settings.section import SettingsError, alike
from companion.settings.settings import Settings
from companion.storage.reading import open_file

MAX_BYTES = 1_000_000


def load_settings(path: Path | None) -> Settings:
    """Read a TOML settings file; None gives the defaults.

    Raises SettingsError (one line: file, place, reason, for an unknown key the known ones).
    """
    if path is None:
        return Settings()
    try:
        with open_file(path) as file:
            text = file.read(MAX_BYTES + 1)
        if len(text) > MAX_BYTES:
            raise SettingsError(f"{path}: larger than {MAX_BYTES} bytes; a short TOML file is expected")
        data = tomllib.loads(text.decode("utf-8"))
    except OSError as error:
        raise SettingsError(
            f"{path}: cannot be read: {error.strerror}; name a TOML file, or leave --settings out"
        ) from error
    except UnicodeDecodeError as error:
        raise SettingsError(f"{path}: not UTF-8 text (byte {error.start})") from error
    except tomllib.TOMLDecodeError as error:
        raise SettingsError(f"{path}: not valid TOML: {error}") from error
    except (RecursionError, ValueError) as error:
        raise SettingsError(f"{path}: not valid TOML: {str(error)[:80]}") from error
    return parse_settings(data, str(path))


def parse_settings(data: dict[str, object], source: str) -> Settings:
    """Settings from parsed TOML. Raises SettingsError naming ``source``."""
    if data.get("profile") == "paper":
        navigator = data.setdefault("navigator", {})
        if isinstance(navigator, dict):
            navigator.setdefault("planner", "bspline-ga")
    try:
        return Settings.model_validate(data)
    except ValidationError as error:
        raise SettingsError(f"{source}: {describe_first(error, Settings)}") from error


def describe_first(error: ValidationError, model: type[BaseModel]) -> str:
    """The first fault of a validation as one line: place, reason, and for an unknown key one that is spelt nearly so, else all."""
    # Keys in quotes may hold anything.
    return "".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in _described(error, model))


def _described(error: ValidationError, model: type[BaseModel]) -> str:
    fault = error.errors(include_url=False)[0]
    place = ".".join(str(part) for part in fault["loc"]) or "file"
    if fault["type"] == "missing":
        return f"{place}: field required, it is missing"
    if fault["type"] == "value_error":
        return f"{place}: {fault['msg'].removeprefix('Value error, ')}"
    if fault["type"] != "extra_forbidden":
        return f"{place}: {fault['msg'].lower()} (got {fault.get('input')!r:.60})"
    known = _known_keys(model, fault["loc"][:-1])
    near = alike(str(fault["loc"][-1]), known)
    hint = f", did you mean '{near}'?" if near else f"; known here: {', '.join(known)}"
    return f"{place}: unknown key{hint}"


def _known_keys(model: type[BaseModel], place: tuple[int | str, ...]) -> list[str]:
    """The keys of the model at a place; lists and optional values are looked through."""
    for part in place:
        field = model.model_fields.get(str(part))
        if field is not None:
            inside = (field.annotation, *get_args(field.annotation))
            model = next((kind for kind in inside if isinstance(kind, type) and issubclass(kind, BaseModel)), model)
    return list(model.model_fields)
