"""Every row of the table of measured facts, sent to the simulator as packets: results, texts, silences, motion."""

import pytest

from tests.conformance.sheet import Row, differences, read_rows
from tests.conformance.tolerated import ROWS


@pytest.mark.parametrize("row", [row for row in read_rows() if str(row) not in ROWS], ids=str)
def test_row(row: Row) -> None:
    assert differences(row) == []


@pytest.mark.parametrize("row", [row for row in read_rows() if str(row) in ROWS], ids=str)
def test_row_that_is_known_to_differ_does(row: Row) -> None:
    """Otherwise it does not belong on the list of differences any more."""
    assert differences(row) != []


def test_the_list_of_differences_names_rows_of_the_table() -> None:
    assert set(ROWS) <= {str(row) for row in read_rows()}


def test_every_row_is_there_once() -> None:
    names = [str(row) for row in read_rows()]
    assert len(names) == len(set(names)) > 200
