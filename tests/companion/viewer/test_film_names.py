"""Names of targets on a film can be read, however long and many they are."""

from __future__ import annotations

from itertools import combinations

from companion.viewer.film_names import MOST_LETTERS, film_names, shortened

SIZE = (640, 272)


def width_of(text: str) -> float:
    return 7.0 * len(text)


def test_a_name_stands_above_its_mark_and_below_it_at_the_upper_edge() -> None:
    assert [(one.text, one.x, one.y) for one in film_names([("gate", 300.0, 100.0)], width_of, SIZE)] == [
        ("gate", 300.0, 84.0)
    ]
    assert film_names([("gate", 300.0, 20.0)], width_of, SIZE)[0].y == 36.0


def test_no_name_lies_upon_another_or_leaves_the_picture() -> None:
    targets = [(f"shelf {n} of the hall with the very long name {n}", 40.0 * n, 100.0 + n) for n in range(17)]
    placed = film_names(targets, width_of, SIZE)
    assert 4 < len(placed) < len(targets)
    assert not any(one.meets(other) for one, other in combinations(placed, 2))
    assert all(one.x - one.half >= 0.0 and one.x + one.half <= SIZE[0] for one in placed)


def test_a_long_name_keeps_its_beginning_and_its_end() -> None:
    assert shortened("the loading bay") == "the loading bay"
    short = shortened("shelf 7 of the hall with the very long name, second row 07")
    assert short.startswith("shelf 7 of") and short.endswith("row 07") and len(short) <= MOST_LETTERS
