"""What ``doctor`` says of a lidar whose port another program has open."""

from __future__ import annotations

import os
import subprocess
import sys
from types import SimpleNamespace

from companion.cli.doctor import _with_rivals
from companion.lidar.models import model_named


def test_another_program_on_the_lidars_port_is_named() -> None:
    mine, theirs = os.openpty()
    port = os.ttyname(theirs)
    counters = SimpleNamespace(bytes=0)
    reader = SimpleNamespace(
        name="lidar", counters=counters, spec=SimpleNamespace(port=port, model=model_named("LD19"))
    )
    alone = _with_rivals(reader)  # type: ignore[arg-type]
    assert alone is not None and alone.says.endswith("nothing comes")
    code = f"import sys; port = open({port!r}, 'rb', buffering=0); print('open', flush=True); sys.stdin.read()"
    with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        try:
            assert other.stdout is not None and other.stdout.readline() == b"open\n"
            found = _with_rivals(reader)  # type: ignore[arg-type]
        finally:
            other.kill()
    os.close(mine)
    os.close(theirs)
    assert found is not None and found.name == "lidar-silent"
    assert f"(process {other.pid}) has the same port open and takes bytes away" in found.says
    assert found.remedy == "stop that program"
