"""What goes wrong in a part of one's own is told as its fault; what goes wrong elsewhere is not."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.core.interrupts import SignalExit
from companion.core.own_parts import OwnKind, OwnPartError, blamed, made_by


@pytest.fixture
def lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "wrong_lines.py").write_text("def Lines(settings):\n    return [][settings]\n")
    monkeypatch.syspath_prepend(tmp_path)


def test_the_line_at_which_a_part_of_ones_own_fails_is_told(lines: None) -> None:
    with pytest.raises(OwnPartError) as told:
        made_by(OwnKind.PLANNER, "wrong_lines:Lines", (), 0)
    assert str(told.value).endswith("cannot be made: IndexError: list index out of range (wrong_lines.py, line 2)")


def test_what_fails_in_a_part_of_ones_own_is_told_with_its_name_in_one_line() -> None:
    with pytest.raises(OwnPartError) as told, blamed(OwnKind.PLANNER, "lines:Lines"):
        raise RuntimeError("my\nbug")
    assert str(told.value) == "planner 'lines:Lines' fails: RuntimeError: my bug"


def test_what_fails_in_one_of_the_programs_own_stays_as_it_is() -> None:
    with pytest.raises(ZeroDivisionError), blamed(OwnKind.PLANNER, "astar"):
        raise ZeroDivisionError


def test_an_interrupt_is_nobodys_fault() -> None:
    with pytest.raises(KeyboardInterrupt), blamed(OwnKind.CONTROLLER, "dice:Dice"):
        raise KeyboardInterrupt


def test_a_part_that_ends_the_program_fails_but_a_signal_ends_it() -> None:
    with pytest.raises(OwnPartError, match="SystemExit: 0"), blamed(OwnKind.CONTROLLER, "dice:Dice"):
        raise SystemExit(0)
    with pytest.raises(SignalExit), blamed(OwnKind.CONTROLLER, "dice:Dice"):
        raise SignalExit(130)
