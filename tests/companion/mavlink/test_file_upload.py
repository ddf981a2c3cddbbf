"""Uploading a file to the simulated autopilot, over good lines and bad ones."""

from __future__ import annotations

import random
from typing import Any

import pytest

from companion.mavlink.byte_link import MemoryLink
from companion.mavlink.file_upload import FileUpload, UploadEnd, checksum
from companion.settings import Settings
from sitl.autopilot import ftp
from sitl.autopilot.channel import Channel
from sitl.autopilot.messages import HANDLERS
from sitl.autopilot.vehicle import Vehicle
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


OLD = b"local COMPANION = 191"
LONG = DATA * 20
"""It takes longer than a second, after which the rover says whether it is armed."""


@pytest.mark.parametrize("lost_share", [0.0, 0.3])
def test_the_file_that_was_there_is_replaced(lost_share: float) -> None:
    line = Line(lost_share)
    files = line.simulator.vehicle.storage.files
    files["scripts/a.lua"] = bytearray(OLD)
    assert line.run(FileUpload(line.near, Settings().link, ["scripts/a.lua"], DATA)) is UploadEnd.DONE
    assert files == {"scripts/a.lua": bytearray(DATA)}


def test_an_upload_that_ends_on_the_way_leaves_the_file_that_was_there() -> None:
    line = Line()
    files = line.simulator.vehicle.storage.files
    files["scripts/a.lua"] = bytearray(OLD)
    upload = FileUpload(line.near, Settings().link, ["scripts/a.lua"], LONG)
    while not files.get("scripts/a.lua.new") and upload.end is None:
        line.run(upload, STEP_S)
    line.simulator.vehicle.armed = True
    assert line.run(upload) is UploadEnd.ARMED and not upload.removed
    assert 0 < len(files["scripts/a.lua.new"]) < len(LONG)
    assert files["scripts/a.lua"] == OLD
    line.simulator.vehicle.armed = False
    line.simulator.advance_to_s(line.simulator.time_s + 2.0)
    assert line.run(FileUpload(line.near, Settings().link, ["scripts/a.lua"], DATA)) is UploadEnd.DONE
    assert files == {"scripts/a.lua": bytearray(DATA)}


def test_whoever_ends_while_names_change_hears_that_the_old_file_may_be_gone() -> None:
    line = Line()
    files = line.simulator.vehicle.storage.files
    files["scripts/a.lua"] = bytearray(OLD)
    upload = FileUpload(line.near, Settings().link, ["scripts/a.lua"], DATA)
    while "scripts/a.lua" in files and upload.end is None:
        line.run(upload, 0.5 * STEP_S)
    upload.give_up()
    assert upload.end is UploadEnd.SILENT and upload.removed


def test_an_autopilot_that_cannot_rename_keeps_the_old_file(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sitl.autopilot.ftp.RENAME", 99)
    monkeypatch.setattr("sitl.autopilot.ftp.OPERATIONS", set(range(1, 13)) | {14, 15})
    line = Line()
    files = line.simulator.vehicle.storage.files
    files["scripts/a.lua"] = bytearray(OLD)
    assert line.run(FileUpload(line.near, Settings().link, ["scripts/a.lua"], DATA)) is UploadEnd.NOT_RENAMED
    assert files["scripts/a.lua"] == OLD


def test_the_session_is_the_one_that_the_autopilot_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    """Newer firmware opens files in sessions of its own numbers."""
    line, asked, answer = Line(), list[tuple[int, int]](), ftp.answer_file_request

    def with_session(vehicle: Vehicle, channel: Channel, message: Any) -> None:
        request = bytearray(message.payload)
        asked.append((request[3], request[2]))
        if request[3] == ftp.CREATE:
            request[2] = 7
        message.payload = bytes(request)
        answer(vehicle, channel, message)

    monkeypatch.setitem(HANDLERS, "FILE_TRANSFER_PROTOCOL", with_session)
    assert line.run(FileUpload(line.near, Settings().link, ["scripts/a.lua"], DATA)) is UploadEnd.DONE
    assert {session for operation, session in asked if operation == ftp.WRITE} == {7}


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
