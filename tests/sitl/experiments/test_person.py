"""The person who sets GUIDED and arms."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from companion.safety.reasons import Activity, Reason, RunPhase, WaitReason
from sitl.autopilot.state import Mode
from sitl.experiments import person as person_module
from sitl.experiments.person import Person

DISARMED = Activity(RunPhase.STOPPED_AND_WAITING, awaited=Reason(WaitReason.PERSON_ARMS_AGAIN))


class Vehicle:
    """What the person sees of a run."""

    def __init__(self) -> None:
        self.simulator = self
        self.time_s = 0.0
        self.vehicle = "the vehicle"
        self.pilot_acts = False


def test_the_person_helps_when_asked_for_long_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    modes, armed = [], []
    monkeypatch.setattr(person_module, "set_mode", lambda vehicle, mode: modes.append(mode) or True)
    monkeypatch.setattr(person_module, "arm", lambda vehicle: armed.append(vehicle) or True)
    person, run = Person(), Vehicle()
    for run.time_s in np.arange(0.0, 7.5, 0.5):
        person.look(run, DISARMED)  # type: ignore[arg-type]
    person.look(run, Activity(RunPhase.DRIVING))  # type: ignore[arg-type]
    for run.time_s in np.arange(8.0, 15.5, 0.5):
        person.look(run, DISARMED)  # type: ignore[arg-type]
    assert (person.helped, modes, armed) == (0, [], [])
    run.time_s = 16.0
    person.look(run, DISARMED)  # type: ignore[arg-type]
    assert (person.helped, modes, armed) == (1, [Mode.GUIDED], ["the vehicle"])


def test_the_person_leaves_a_pilot_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    modes: list[float] = []
    person, run = Person(), Vehicle()
    monkeypatch.setattr(person_module, "set_mode", lambda vehicle, mode: modes.append(run.time_s) or True)
    monkeypatch.setattr(person_module, "arm", lambda vehicle: True)
    for run.time_s in np.arange(0.0, 40.0, 0.5):
        run.pilot_acts = run.time_s < 20.0
        person.look(run, DISARMED if not modes else Activity(RunPhase.DRIVING))  # type: ignore[arg-type]
    assert modes == [28.0]


def test_a_person_who_is_refused_gives_up_in_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    stopped: list[bool] = []
    monkeypatch.setattr(person_module, "set_mode", lambda vehicle, mode: False)
    monkeypatch.setattr(person_module, "arming_faults", lambda vehicle: ())
    person, run = Person(), Vehicle()
    run.companion = SimpleNamespace(stop=lambda: stopped.append(True))  # type: ignore[attr-defined]
    for run.time_s in np.arange(0.0, 200.0, 0.5):
        person.look(run, DISARMED)  # type: ignore[arg-type]
        if stopped:
            break
    assert (person.helped, person.gave_up, stopped) == (0, "GUIDED refused", [True])
