"""Every reader of outside bytes: the inputs that once broke it, and its own files with pieces changed.

``make fuzz`` looks much further; it uses the same targets.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.executive.requested_goals import RequestedGoals
from companion.operator.parameter_server import ParameterServer
from companion.supervision.fence_monitor import FenceMonitor
from tests.fuzz.finds import FINDS
from tests.fuzz.targets import REFUSALS, BadRefusalError, refusing, targets

TARGETS = targets()
CHANGES = st.lists(st.tuples(st.floats(0.0, 1.0), st.integers(0, 8), st.binary(max_size=8)), min_size=1, max_size=6)


@pytest.mark.parametrize("number", range(len(FINDS)))
def test_what_was_found_once_is_refused(number: int) -> None:
    assert_read_or_refused_in_one_line(*FINDS[number])


@pytest.mark.parametrize("name", TARGETS)
def test_of_its_own_files_some_are_read_to_the_end(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    refused: list[str] = []  # missions without the maps beside them, for one
    monkeypatch.setattr("tests.fuzz.targets.refusing", lambda: noting(refused))
    for example in TARGETS[name].examples:
        TARGETS[name].read(example)
    assert len(refused) < len(TARGETS[name].examples)


@pytest.mark.parametrize("name", sorted(TARGETS.keys() - {"driving"}))
@given(data=st.data())
@settings(max_examples=25, deadline=None)
def test_changed_files_are_read_or_refused_in_one_line(name: str, data: st.DataObject) -> None:
    assert_read_or_refused_in_one_line(name, changed(name, data))


@given(data=st.data())
@settings(max_examples=6, deadline=None)  # each is a drive
def test_changed_packets_are_survived_by_a_companion_that_drives(data: st.DataObject) -> None:
    assert_read_or_refused_in_one_line("driving", changed("driving", data))


@pytest.mark.parametrize(
    ("example", "part", "method"),
    [(1, ParameterServer, "_change"), (2, RequestedGoals, "_judge"), (3, FenceMonitor, "doubt")],
)
def test_packets_reach_whom_they_are_for(
    example: int, part: type, method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    reached = []
    before = getattr(part, method)

    def watched(*given: object, **named: object) -> object:
        answer = before(*given, **named)
        reached.append(answer)
        return answer

    monkeypatch.setattr(part, method, watched)
    TARGETS["driving"].read(TARGETS["driving"].examples[example])
    assert any(reached) if method == "doubt" else reached


def assert_read_or_refused_in_one_line(name: str, data: bytes) -> None:
    """What else comes out of a reader fails: also a refusal that is no clear line."""
    TARGETS[name].read(data)


@contextlib.contextmanager
def noting(refused: list[str]) -> Iterator[None]:
    """Notes what is refused; a refusal that is no clear line still comes through."""
    with refusing():
        try:
            yield
        except REFUSALS as error:
            refused.append(str(error))
            raise


def changed(name: str, data: st.DataObject) -> bytes:
    """One of its own files, with pieces of it cut out and others put in."""
    bytes_in = data.draw(st.sampled_from(TARGETS[name].examples))
    for where, cut, put in data.draw(CHANGES):
        at = int(where * len(bytes_in))
        bytes_in = bytes_in[:at] + put + bytes_in[at + cut :]
    return bytes_in


@pytest.mark.parametrize("text", ["two\nlines", "a bell\a", "x" * 2000])
def test_a_refusal_that_is_no_clear_line_is_a_find(text: str) -> None:
    from companion.settings import SettingsError

    with pytest.raises(BadRefusalError), refusing():
        raise SettingsError(text)
