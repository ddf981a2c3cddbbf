"""Deskewing: the readings of a turning lidar, taken one after the other, as if all were taken at the end of the scan.

A lidar needs 0.1 to 0.2 s for a turn. A rover that turns by 90 degrees a second would smear what it sees by as much as
18 degrees, and one that drives 2 m/s by 0.4 m.

Nouns: deskewing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from companion.core.scan import RangeScan


def deskewed(scan: RangeScan, forward_m_s: float, yaw_rate_rad_s: float) -> RangeScan:
    """The scan of a rover that moved evenly while it was taken; unchanged if its readings have no ages.

    ``forward_m_s``: along the heading; ``yaw_rate_rad_s``: clockwise. A reading that hit something is where that lies
    from the rover's place at ``time_s``; of one that hit nothing only the direction changes.
    """
    if scan.age_s is None:
        return scan
    back_rad = -yaw_rate_rad_s * scan.age_s
    hit = np.isfinite(scan.range_m)
    range_m = np.where(hit, scan.range_m, 0.0)
    # The place then, seen from the place now: on the arc behind, whose chord lies half the turn aside.
    behind_m = forward_m_s * scan.age_s * np.sinc(0.5 * back_rad / np.pi)
    bearing_rad = scan.bearing_rad + back_rad
    forward_m = range_m * np.cos(bearing_rad) - behind_m * np.cos(0.5 * back_rad)
    right_m = range_m * np.sin(bearing_rad) - behind_m * np.sin(0.5 * back_rad)
    return replace(
        scan,
        bearing_rad=np.where(hit, np.arctan2(right_m, forward_m), bearing_rad),
        range_m=np.where(hit, np.hypot(forward_m, right_m), scan.range_m),
        age_s=None,
    )
