"""Whether two missions are the same, wherever their files lie and however they are written."""

from __future__ import annotations

import hashlib
from dataclasses import replace

from companion.mission.mission import Mission, MissionError
from companion.storage.reading import open_file


def fingerprint(mission: Mission) -> str:
    """SHA-256, in hexadecimal, of all that decides where the rover drives: not of comments, notes and the simulator's part.

    Nor of the planned home: the rover's own is what counts, and an autopilot tells its stored mission with its home of now.
    A known map counts with its contents. Raises MissionError when that cannot be read.
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
