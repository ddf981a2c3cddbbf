"""The fast form of ``dataclasses.replace``."""

from dataclasses import FrozenInstanceError, dataclass, replace

import pytest

from companion.core.changed import changed


@dataclass(frozen=True)
class State:
    """Any state."""

    speed_m_s: float = 1.0
    name: str = "state"


def test_fields_change_in_a_copy() -> None:
    before = State()
    after = changed(before, speed_m_s=2.0)
    assert after == replace(before, speed_m_s=2.0) and before == State()
    with pytest.raises(FrozenInstanceError):
        after.speed_m_s = 3.0  # type: ignore[misc]


def test_a_field_that_there_is_not_is_refused() -> None:
    with pytest.raises(TypeError):
        changed(State(), weight_kg=2.0)
