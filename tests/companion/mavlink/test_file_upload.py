"""Uploading a file to the simulated autopilot, over good lines and bad ones."""

from __future__ import annotations

import random

import pytest

from companion.mavlink.byte_link import MemoryLink
from companion.mavlink.file_upload import FileUpload, UploadEnd, checksum
from companion.settings import Settings
from tests.support.sitl_client import open_ground

DATA = bytes(range(256)) * 5
STEP_S = 0.02


class Line:
    """The simulator at the other end of a line that loses packets."""

    def __init__(self, lost_share: float = 0.0) -> None:
        self.simulator = open_ground()
        self.vehicle = self.simulator.connect()
        self.near, self.far = MemoryLink.pair()
        self._rng, self._lost_share = random.Random(0), lost_share

    def run(self, upload: FileUpload, seconds: float = 60.0) -> UploadEnd | None:
        until_s = self.simulator.time_s + seconds
        while upload.end is None and self.simulator.time_s < until_s:
            upload.step(self.simulator.time_s)
            for packet in self._kept(self.far.read()):
                self.vehicle.receive(packet)
            self.simulator.advance_to_s(self.simulator.time_s + STEP_S)
            for packet in self._kept(self.vehicle.take()):
                self.far.write(packet)
        return upload.end

    def _kept(self, data: bytes) -> list[bytes]:
        return [] if self._rng.random() < self._lost_share else [data]


@pytest.mark.parametrize("lost_share", [0.0, 0.3])
@pytest.mark.parametrize("size", [1, 200, 1280])
def test_a_file_is_there_afterwards_byte_by_byte(lost_share: float, size: int) -> None:
    line = Line(lost_share)
    upload = FileUpload(line.near, Settings().link, ["/APM/scripts/a.lua", "scripts/a.lua"], DATA[:size])
    assert line.run(upload) is UploadEnd.DONE
    assert upload.place == "scripts/a.lua"
    assert bytes(line.simulator.vehicle.storage.files["scripts/a.lua"]) == DATA[:size]


def test_a_folder_that_is_not_there_is_told() -> None:
    line = Line()
    assert line.run(FileUpload(line.near, Settings().link, ["/APM/scripts/a.lua"], DATA)) is UploadEnd.NO_FOLDER


def test_a_file_that_is_too_large_is_told() -> None:
    line = Line()
    upload = FileUpload(line.near, Settings().link, ["scripts/a.lua"], DATA * 100)
    assert line.run(upload) is UploadEnd.NOT_WRITTEN


def test_an_armed_rover_is_left_alone() -> None:
    line = Line()
    line.simulator.vehicle.armed = True
    assert line.run(FileUpload(line.near, Settings().link, ["scripts/a.lua"], DATA)) is UploadEnd.ARMED
    assert line.simulator.vehicle.storage.files == {}


def test_an_autopilot_that_does_not_answer_is_given_up() -> None:
    line = Line()
    upload = FileUpload(line.near, Settings().link, ["scripts/a.lua"], DATA)
    upload.step(0.0)
    upload.give_up()
    assert upload.end is UploadEnd.NO_ROVER
    deaf = Line(1.0)
    silent = FileUpload(deaf.near, Settings().link, ["scripts/a.lua"], DATA)
    while not silent.heard:
        deaf.simulator.advance_to_s(deaf.simulator.time_s + 0.5)
        deaf.far.write(deaf.vehicle.take())
        silent.step(deaf.simulator.time_s)
    assert deaf.run(silent) is UploadEnd.SILENT


def test_the_checksum_is_the_autopilots() -> None:
    """CRC-32 without inversions: the polynomial's own table gives 0x77073096 for the byte 1."""
    assert (checksum(b""), checksum(b"\x01")) == (0, 0x77073096)
