"""What is wrong with a TOML file, in one line with file, place, reason and remedy."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import pytest
from pydantic import BaseModel, ConfigDict, Field

from companion.storage.toml_file import read_table, read_toml
from companion.storage.validation import alike


class Wheel(BaseModel):
    model_config = ConfigDict(extra="forbid")

    radius_m: Annotated[float, Field(strict=True)]


class Cart(BaseModel):
    model_config = ConfigDict(extra="forbid")

    name: str = ""
    load_kg: float | bool | None = None
    wheel: list[Wheel] = []


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"a = ", "not valid TOML: Invalid value (at end of document); see the manual"),
        (b"a = '\xff'", "not UTF-8 text (byte 5); save it as UTF-8"),
        (b"a = " + b"[" * 100_000, "not valid TOML: nested too deeply; see the manual"),
        (b"a = " + b"9" * 5000, "not valid TOML: Exceeds the limit"),
        (b"# \n" * 50, "larger than 100 bytes; a short TOML file is expected"),
    ],
)
def test_what_is_no_toml_is_refused_in_one_line(tmp_path: Path, content: bytes, reason: str) -> None:
    file = tmp_path / "f.toml"
    file.write_bytes(content)
    with pytest.raises(KeyError) as caught:
        read_toml(file, KeyError, remedy="see the manual", limit=100 if content[:1] == b"#" else 1_000_000)
    (text,) = caught.value.args
    assert text.startswith(f"{file}: {reason}") and "\n" not in text


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    none = tmp_path / "none.toml"
    assert read_toml(none, KeyError, missing_ok=True) == {}
    with pytest.raises(KeyError, match=r"none\.toml: cannot be read: No such file or directory; name one"):
        read_toml(none, KeyError, name_it="name one")
    with pytest.raises(KeyError, match="cannot be read: Is a directory; check the path"):
        read_toml(tmp_path, KeyError, missing_ok=True)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("[[wheel]]\nradius_m = 1.0\n[[wheel]]\n", "wheel 2.radius_m: is missing, and must be given; see the manual"),
        ("[[wheel]]\nradius = 1.0", "wheel 1.radius_m: is missing, and must be given"),
        ("[[wheel]]\nradius_m = 'a'", "wheel 1.radius_m: must be a number (got 'a'); see"),
        (
            "[[wheel]]\nradius_m = '0,3'",
            "wheel 1.radius_m: must be a number (got '0,3'); write 0.3 without",
        ),
        ("[wheel]\nradius_m = 1.0", "wheel: one table where several may stand; write [[wheel]] with double brackets"),
        ("\ufeffname = 1", "name: must be a text in quotes"),
        ("nam = 'a'", "nam: unknown key, did you mean 'name'?; see the manual"),
        ('"a\\nb" = 1', "a\\nb: unknown key; known here: name, load_kg, wheel"),
    ],
)
def test_a_wrong_table_is_told_with_its_place_counted_from_one(tmp_path: Path, content: str, reason: str) -> None:
    file = tmp_path / "f.toml"
    file.write_text(content)
    with pytest.raises(KeyError) as caught:
        read_table(file, Cart, KeyError, "see the manual")
    (text,) = caught.value.args
    assert text.startswith(f"{file}: {reason}") and "\n" not in text


@pytest.mark.parametrize(
    ("name", "near"), [("hibryd", "hybrid"), ("teta-star", "theta-star"), ("atsar", "astar"), ("", ""), ("rrt", "")]
)
def test_only_names_with_nearly_the_same_spelling_are_offered(name: str, near: str) -> None:
    assert alike(name, ["hybrid", "theta-star", "astar", "prm", "dijkstra"]) == near


@pytest.mark.parametrize(
    ("content", "also"),
    [
        ("name = 1", ""),
        ("load_kg = 'a'", ""),
        ("name = 1\nload_kg = 'a'\nnmae = 1", " (also wrong: load_kg, nmae)"),
        (
            "name = 1\n" + "[[wheel]]\n" * 5,
            " (also wrong: wheel 1.radius_m, wheel 2.radius_m, wheel 3.radius_m, and 2 more)",
        ),
        ("[[wheel]]\nradius_m = 1\n[[wheel]]\nradius_m = 'b'\nwidth_m = 1", " (also wrong: wheel 2.width_m)"),
    ],
)
def test_what_else_is_wrong_is_named_by_its_place(tmp_path: Path, content: str, also: str) -> None:
    file = tmp_path / "f.toml"
    file.write_text(content)
    with pytest.raises(KeyError) as caught:
        read_table(file, Cart, KeyError)
    (text,) = caught.value.args
    assert text.endswith(also) if also else "also wrong" not in text
