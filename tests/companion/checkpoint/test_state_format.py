"""The state file comes back as it was written, and whatever else the bytes are, they are refused."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from companion.checkpoint.state_format import (
    MAGIC,
    DamagedStateError,
    SavedState,
    StateError,
    decode_state,
    encode_state,
)
from tests.support.quick import examples
from tests.support.states import a_state, forged, parts_of, rasters_of, sealed, states

QUICK = settings(max_examples=examples(60), deadline=None, suppress_health_check=[HealthCheck.too_slow])


def written() -> bytes:
    state = a_state()
    return encode_state(state, parts_of(rasters_of(state, 1), 3))


@QUICK
@given(states(), st.integers(0, 2**32 - 1), st.integers(1, 30))
def test_what_was_written_comes_back(state: SavedState, seed: int, step: int) -> None:
    rasters = rasters_of(state, seed)
    found, map_found = decode_state(encode_state(state, parts_of(rasters, step)))
    assert found == state
    assert all(np.array_equal(map_found[name], rasters[name]) for name in ("log_odds", "penalty"))


@QUICK
@given(states())
def test_what_has_not_been_written_yet_of_the_map_is_unknown(state: SavedState) -> None:
    assert not any(raster.any() for raster in decode_state(encode_state(state, {}))[1].values())


def test_a_file_that_is_cut_anywhere_is_damaged() -> None:
    data = written()
    for length in range(len(data)):
        with pytest.raises(DamagedStateError):
            decode_state(data[:length])


def test_a_file_with_any_other_byte_is_damaged() -> None:
    data = written()
    for place in range(len(data)):
        for flip in (0x01, 0x80, 0xFF):
            with pytest.raises(DamagedStateError):
                decode_state(data[:place] + bytes([data[place] ^ flip]) + data[place + 1 :])


@QUICK
@given(st.binary(max_size=300))
def test_any_bytes_are_refused(data: bytes) -> None:
    with pytest.raises(DamagedStateError):
        decode_state(data)
    with pytest.raises(StateError):
        decode_state(sealed(data))
    with pytest.raises(StateError):
        decode_state(sealed(MAGIC + b"1\n" + data))


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=12,
)


@QUICK
@given(JSON)
def test_a_head_that_is_none_is_refused_though_its_checksum_is_right(head: Any) -> None:
    for forgery in (head, {"state": head, "parts": []}, {"state": a_state().model_dump(mode="json"), "parts": [head]}):
        with pytest.raises(DamagedStateError):
            decode_state(forged(forgery))


def paths(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *(deeper for key, part in inner for deeper in paths(part, (*path, key)))]


def replaced(value: Any, path: tuple[Any, ...], new: Any) -> Any:
    if not path:
        return new
    inner = dict(value) if isinstance(value, dict) else list(value)
    inner[path[0]] = replaced(value[path[0]], path[1:], new)
    return inner


WRONG = ("x", -5, 10**400, 1e308, [[]], {"a": 1}, None, True)


def test_a_value_that_is_none_is_refused_or_harmless_wherever_it_stands() -> None:
    """With a right checksum: no traceback, and never more memory than a map may take."""
    good = a_state().model_dump(mode="json")
    refused = 0
    for path in paths(good):
        for wrong in WRONG:
            try:
                state, rasters = decode_state(forged({"state": replaced(good, path, wrong), "parts": []}))
            except DamagedStateError as error:
                refused += 1
                assert len(str(error).splitlines()) == 1
                continue
            assert state.ground.width * state.ground.height <= 4_000_000
            assert rasters["log_odds"].size <= 16_000_000
    assert refused > 5 * len(paths(good))


@pytest.mark.parametrize(
    ("table", "parts"),
    [
        ([["log_odds", 0, 1, 0, 14, 4]], b"abcd"),
        ([["log_odds", -1, 1, 0, 14, 9]], zlib.compress(bytes(56))),
        ([["log_odds", 10, 1, 0, 14, 14]], zlib.compress(bytes(56))),
        ([["log_odds", 0, 2, 0, 14, 14]], zlib.compress(bytes(56))),
        ([["log_odds", 0, 1, 0, 14, 10**9]], zlib.compress(bytes(56))),
        ([["log_odds", 0, 1, 0, 14, len(zlib.compress(bytes(10**7)))]], zlib.compress(bytes(10**7))),
        ([["log_odds", 0, 1, 0, 14, len(zlib.compress(b"\xff" * 56))]], zlib.compress(b"\xff" * 56)),
        ([["walls", 0, 1, 0, 14, 0]], b""),
        ([["log_odds", 0.0, 1, 0, 14, 0]], b""),
        ([["log_odds", 0, 1]], b""),
        ([["log_odds", 0, 1, -1, 14, 14]], zlib.compress(bytes(56))),
        ([["log_odds", 0, 1, 1, 14, 14]], zlib.compress(bytes(56))),
        ([], b"left over"),
    ],
    ids=[
        "no deflate",
        "before",
        "behind",
        "too few",
        "too long",
        "bomb",
        "NaN",
        "name",
        "no row",
        "short",
        "west",
        "east",
        "left over",
    ],
)
def test_parts_that_do_not_fit_are_refused(table: list[Any], parts: bytes) -> None:
    with pytest.raises(DamagedStateError):
        decode_state(forged({"state": a_state().model_dump(mode="json"), "parts": table}, parts))


def test_another_version_is_named_and_not_called_damaged() -> None:
    with pytest.raises(StateError, match="format '7'") as caught:
        decode_state(sealed(MAGIC + b"7\n" + b"whatever"))
    assert not isinstance(caught.value, DamagedStateError)


def test_a_part_that_no_run_writes_takes_no_memory() -> None:
    """100 million cells of one value would be 400 kB in the file."""
    ground = {**a_state().ground.model_dump(), "width": 2000, "height": 1990, "subdivisions": 5}
    wide = replaced(a_state().model_dump(mode="json"), ("ground",), ground)
    data = zlib.compress(bytes(100))
    with pytest.raises(DamagedStateError, match="too large"):
        decode_state(forged({"state": wide, "parts": [["log_odds", 0, 9950, 0, 10000, len(data)]]}, data))
