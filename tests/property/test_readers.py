"""Every reader of bytes from outside: what it once stumbled over, and what its files become when pieces of them are changed.

``make fuzz`` looks much further; it uses the same targets.
"""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fuzz.finds import FINDS
from tests.fuzz.targets import BadRefusalError, refusing, targets

TARGETS = targets()
CHANGES = st.lists(st.tuples(st.floats(0.0, 1.0), st.integers(0, 8), st.binary(max_size=8)), min_size=1, max_size=6)


@pytest.mark.parametrize("number", range(len(FINDS)))
def test_what_was_found_once_is_refused(number: int) -> None:
    name, data = FINDS[number]
    TARGETS[name].read(data)


@pytest.mark.parametrize("name", TARGETS)
def test_its_own_files_are_read(name: str) -> None:
    for example in TARGETS[name].examples:
        TARGETS[name].read(example)


@pytest.mark.parametrize("name", TARGETS)
@given(data=st.data())
@settings(max_examples=25, deadline=None)
def test_changed_files_are_read_or_refused_in_one_line(name: str, data: st.DataObject) -> None:
    bytes_in = data.draw(st.sampled_from(TARGETS[name].examples))
    for where, cut, put in data.draw(CHANGES):
        at = int(where * len(bytes_in))
        bytes_in = bytes_in[:at] + put + bytes_in[at + cut :]
    TARGETS[name].read(bytes_in)


@pytest.mark.parametrize("text", ["two\nlines", "a bell\a", "x" * 2000])
def test_a_refusal_that_is_no_clear_line_is_a_find(text: str) -> None:
    from companion.settings import SettingsError

    with pytest.raises(BadRefusalError), refusing():
        raise SettingsError(text)
