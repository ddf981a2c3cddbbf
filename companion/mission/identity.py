"""Fingerprint of a mission: equal for equal missions, whatever their files are called and how they are written."""

from __future__ import annotations

import hashlib
from dataclasses import replace

from companion.mission.mission import Mission, MissionError
from companion.storage.files import open_file


def fingerprint(mission: Mission) -> str:
    """SHA-256, in hexadecimal, of everything that decides where the rover drives.

    Comments, notes and the simulator's table do not count. Neither does the planned home: the rover's own home counts,
    and an autopilot sends its stored mission with its present home. A prior map counts with its content. Raises
    MissionError when that cannot be read.
    """
    plain = replace(mission, source=None, notes=(), sitl=None, prior_map=None, planned_home=None, stored="")
    digest = hashlib.sha256(repr(plain).encode())
    if mission.prior_map is not None:
        try:
            with open_file(mission.prior_map) as file:
                digest.update(file.read())
        except OSError as error:
            raise MissionError(
                f"prior_map: {mission.prior_map}: cannot be read: {error.strerror}; check the path"
            ) from error
    return digest.hexdigest()
