"""Signed MAVLink between companion and simulated autopilot, which got its key with SETUP_SIGNING."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from typer.testing import CliRunner

from companion.cli.commands import app
from companion.mavlink.signing import MINUTE, TICKS_PER_S, Signer
from companion.mission.load import load_mission
from companion.mission.mission import Mission
from companion.recording.reader import load_record
from companion.recording.recorder import Recorder
from companion.replay.replay import replay
from companion.safety.reasons import RunPhase, WaitReason
from tests.support.party import KEY, TIME, Party
from tests.support.rig import GUIDED, Rig, yard
from tests.support.served import mission_path

RADIO_PORT = 1
"""Of the vehicle: on its first one it believes anybody."""


def signing_rig(folder: Path, vehicle_key: bytes | None = KEY, our_key: bytes | None = KEY) -> Rig:
    """The companion on the radio port, 45 s after the vehicle was switched on; the vehicle's key has just been set."""
    holder: list[Rig] = []

    def clock() -> int:
        return TIME + round(holder[0].now_s() * TICKS_PER_S) if holder else TIME

    signer = None if our_key is None else Signer(our_key, clock)
    folder.mkdir(exist_ok=True)
    rig = Rig(yard(folder), late_s=45.0, port=RADIO_PORT, signer=signer)
    holder.append(rig)
    if vehicle_key is not None:
        rig.station(mavlink.MAVLink_setup_signing_message(1, 1, list(vehicle_key), TIME))
    return rig


def rig_mission(folder: Path) -> Mission:
    """The one it drives."""
    return load_mission(folder / "yard.toml")


def refused(rig: Rig) -> tuple[int, int, int]:
    found = rig.link.codec.counters.refused
    return found.unsigned, found.wrong, found.old


def test_a_mission_is_driven_with_signed_packets(tmp_path: Path) -> None:
    rig = signing_rig(tmp_path)
    rig.finish()
    assert rig.companion.outcome.complete
    packets = [bytes(sent.message.get_msgbuf()) for sent in rig.sent]
    assert {packet[2] for packet in packets} == {1}
    times = [int.from_bytes(packet[-12:-6], "little") for packet in packets]
    assert times == sorted(set(times))


def test_commands_of_those_without_the_key_change_nothing_and_are_counted(tmp_path: Path) -> None:
    rig = signing_rig(tmp_path)
    rig.until(lambda: rig.mode == GUIDED and rig.armed)
    before = refused(rig)
    owner = Party(rig.simulator, 255, 190, RADIO_PORT)
    setting: Any = mavlink.MAVLink_param_set_message(1, 191, b"CMP_HORIZON", 6.0, 9)
    # The autopilot's first port believes anybody, and passes on what it got: unsigned, or with another key's signature.
    rig.station(setting)
    forger = Party(rig.simulator, 253, 190, 0)
    forger.sign(b"z" * 32, TIME + 10**9)
    forger.send(setting)
    rig.run_for(0.5)
    assert refused(rig)[:2] == (before[0] + 1, before[1] + 1)
    assert not any(sent.kind == "PARAM_VALUE" for sent in rig.sent)
    assert (
        "Ignoring unsigned packets" in rig.texts() or "Ignoring packets that are signed with another key" in rig.texts()
    )

    owner.sign(timestamp=TIME + 3 * MINUTE)
    sent = owner.send(setting)
    rig.run_for(0.5)
    assert [s.message.param_value for s in rig.sent if s.kind == "PARAM_VALUE"] == [6.0]
    old = refused(rig)[2]
    forger.link.receive(sent)  # the same once more, through the port that believes anybody
    rig.run_for(0.5)
    assert refused(rig)[2] == old + 1
    assert len([s for s in rig.sent if s.kind == "PARAM_VALUE"]) == 1
    texts = rig.texts()
    assert all(texts.count(text) == 1 for text in texts if text.startswith("Ignoring"))


def test_an_autopilot_that_reboots_is_believed_again(tmp_path: Path) -> None:
    rig = signing_rig(tmp_path)
    rig.until_driven(1.0)
    rig.run_for(31.0)  # until the vehicle has saved its timestamp
    rig.pilot(400, 0)
    rig.run_for(1.0)
    rig.pilot(246, 1)
    rig.run_for(5.0)
    assert rig.companion.vehicle.heartbeat is not None
    assert rig.now_s() - rig.companion.vehicle.heartbeat.time_s < 2.0


@pytest.mark.thorough
def test_a_signed_and_tuned_run_is_replayed_without_the_key(tmp_path: Path) -> None:
    rig = signing_rig(tmp_path / "world")
    mission = rig_mission(tmp_path / "world")
    rig.recorder = recorder = Recorder(tmp_path / "record", mission, rig.settings, 0, arm=True)
    rig.restart_companion(mission)
    setting: Any = mavlink.MAVLink_param_set_message(1, 191, b"CMP_SPD_MAX", 0.8, 9)
    owner, forger = Party(rig.simulator, 255, 190, RADIO_PORT), Party(rig.simulator, 253, 190, 0)
    rig.until_driven(1.0)
    rig.station(setting)  # unsigned
    forger.sign(b"z" * 32, TIME + 10**9)
    forger.send(setting)
    rig.run_for(0.5)
    owner.sign(timestamp=TIME + 3 * MINUTE)
    owner.send(setting)
    rig.finish()
    recorder.close()
    assert "CMP_SPD_MAX 20 -> 0.8" in rig.texts() and refused(rig)[:2] >= (1, 1)
    record = (tmp_path / "record" / "link.tlog").read_bytes()
    assert KEY not in record
    again = replay(load_record(tmp_path / "record"))
    assert again.differences == []
    assert again.said > 200
    assert again.companion is not None and again.companion.outcome.said == rig.texts()


def test_keys_that_differ_are_told_of(tmp_path: Path) -> None:
    rig = signing_rig(tmp_path, our_key=b"k" * 32)
    rig.run_for(5.0)
    assert rig.awaits(WaitReason.HEARTBEAT) and "another key" in str(rig.activity)
    assert rig.mode != GUIDED
    assert not any(sent.moves_or_changes for sent in rig.sent)


def test_an_autopilot_without_a_key_is_told_of(tmp_path: Path) -> None:
    rig = signing_rig(tmp_path, vehicle_key=None)
    rig.run_for(5.0)
    assert rig.awaits(WaitReason.HEARTBEAT) and "has the autopilot been given the key?" in str(rig.activity)


def test_a_companion_without_a_key_is_told_of(tmp_path: Path) -> None:
    rig = signing_rig(tmp_path, our_key=None)
    rig.run_for(10.0)
    assert rig.texts().count("The autopilot signs: without --signing-key it ignores us, but on its first port") == 1
    assert rig.does(RunPhase.WAITING)
    assert rig.mode != GUIDED  # it has indeed been ignored


def test_a_key_that_others_may_read_stops_the_run_before_it_begins(tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_text("secret words")
    key.chmod(0o644)
    command = ["run", str(mission_path(yard(tmp_path))), "--connect", "udpin:127.0.0.1:0", "--signing-key", str(key)]
    answer = CliRunner().invoke(app, command)
    assert answer.exit_code == 2
    assert "chmod 600" in answer.output and "secret" not in answer.output.replace(str(key), "")
