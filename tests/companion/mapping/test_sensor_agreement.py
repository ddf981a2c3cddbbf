"""What has just been seen: no other sensor frees it, and it confirms what is seen beside it."""

import numpy as np

from companion.core.scan import RangeScan
from companion.mapping.sensor_agreement import BELIEVED_S, SensorAgreement


def scan(time_s: float, source: str = "lidar", sender: int = 1) -> RangeScan:
    return RangeScan(time_s, np.zeros(1), np.ones(1), 0.1, 8.0, 0.1, source, sender)


def cells(*places: tuple[int, int]) -> np.ndarray:
    return np.array(places, np.int64).reshape(-1, 2)


def test_the_hits_of_other_sensors_count_and_its_own_do_not() -> None:
    agreement = SensorAgreement()
    agreement.note(scan(0.0), cells((1, 2), (3, 4)))
    agreement.note(scan(0.1, sender=158), cells((5, 6)))
    agreement.note(scan(0.1, "sonar"), cells())
    assert agreement.others(scan(0.2)).tolist() == [[5, 6]]
    assert agreement.others(scan(0.2, sender=158)).tolist() == [[1, 2], [3, 4]]
    assert agreement.others(scan(0.2, "sonar")).tolist() == [[1, 2], [3, 4], [5, 6]]
    assert agreement.before(scan(0.2)).tolist() == [[1, 2], [3, 4], [5, 6]]


def test_they_are_believed_for_a_while_and_not_after_a_move_of_the_map() -> None:
    agreement = SensorAgreement()
    agreement.note(scan(0.0), cells((1, 2)))
    assert len(agreement.others(scan(BELIEVED_S, "sonar"))) == 1
    assert len(agreement.before(scan(BELIEVED_S))) == 1
    nothing = agreement.others(scan(BELIEVED_S + 0.01, "sonar"))
    assert nothing.shape == (0, 2) and nothing.dtype == np.int64
    agreement.note(scan(2.0), cells((1, 2)))
    agreement.clear()
    assert len(agreement.others(scan(2.0, "sonar"))) == 0
