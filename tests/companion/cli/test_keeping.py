"""What is said in the end of a state that could not be kept."""

from __future__ import annotations

from pathlib import Path

import pytest

from companion.checkpoint.checkpointer import Checkpointer
from companion.cli.keeping import Keeping
from tests.support.rig import yard


def test_a_state_that_is_older_than_the_run_is_told_with_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with_state = Keeping(yard(tmp_path), tmp_path / "state", resume=False, say=lambda _: None)
    with_state.start()
    assert with_state.problem == ""
    monkeypatch.setattr(Checkpointer, "problem", "mission.state: the state cannot be saved: No space left on device")
    assert with_state.problem.endswith("; make room there or name another place with --state DIR")
    assert with_state.file is not None
    with_state.file.write_bytes(b"as it was")
    assert "do not --resume: mission.state is older than this run" in with_state.problem
    with_state.close()
