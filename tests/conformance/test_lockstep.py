"""The same seed gives the same bytes: in one process, in two, with any order of Python's sets, and on another machine.

Another machine is emulated on this one: a C library without fused multiply-add (its sine and exponential then differ
in the last digit), numpy without vector units, kernels compiled for the plainest processor of the kind.
"""

import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
from numpy._core._multiarray_umath import __cpu_dispatch__

from tests.conformance.hashed_run import hashed_run

ROOT = Path(__file__).resolve().parents[2]
PATIENCE_S = 3000.0
"""On a busy machine all kernels may take many minutes to compile."""


def elsewhere(mission: str, seed: int, **environment: str) -> str:
    """What ``hashed_run`` prints in an interpreter of its own."""
    command = [sys.executable, "-m", "tests.conformance.hashed_run", mission, str(seed)]
    changed = {**os.environ, "PYTHONHASHSEED": "2", **environment}
    return subprocess.run(
        command, cwd=ROOT, env=changed, stdout=subprocess.PIPE, text=True, check=True, timeout=PATIENCE_S
    ).stdout.strip()


EVERYTHING = "+".join(
    (
        "missions/depot.toml",
        "missions/sensors/weathered.toml",
        *(f"missions/faults/{plan}.toml" for plan in ("radio", "gps", "vehicle")),
    )
)
"""Doors, ice, a mover; sensors with every flaw; every kind of fault except those that end the drive."""

AUTO = "auto:missions/depot.toml+missions/sensors/weathered.toml+missions/faults/gps.toml"


X86 = platform.machine() == "x86_64"
NO_FMA = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4"} if X86 else {}
"""Another C library: one that does without fused multiply-add."""

NO_VECTORS = {"NPY_DISABLE_CPU_FEATURES": " ".join(__cpu_dispatch__)} if X86 else {}
"""Another numpy: one without vector units, whose arc tangent and exponential differ in the last digit, and whose sorts
leave equal values in another order."""


def another_machine() -> dict[str, str]:
    """The environment that makes this x86-64 machine another one in its arithmetic; it has kernels of its own."""
    if not X86:
        return {}
    return {**NO_FMA, **NO_VECTORS, "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}


def check_same_bytes(mission: str, environment: dict[str, str]) -> None:
    """In this process, and in another with other sets and other arithmetic."""
    here = hashed_run(mission, 5)
    assert here == elsewhere(mission, 5, **environment), "the same seed in two processes"
    _, packets, driven_m = here.split()
    assert int(packets) > 1000
    assert float(driven_m) > 10.0


@pytest.mark.thorough
@pytest.mark.parametrize(
    "mission", [EVERYTHING, pytest.param(AUTO, marks=pytest.mark.thorough)], ids=["everything", "auto"]
)
def test_the_same_seed_gives_the_same_bytes_with_another_c_library(mission: str) -> None:
    check_same_bytes(mission, NO_FMA)


@pytest.mark.thorough
def test_the_same_seed_gives_the_same_bytes_on_another_machine() -> None:
    """The autopilot drives: its kernels are compiled in a quarter of the time that the planners' take."""
    check_same_bytes("auto:missions/crossing.toml", another_machine())


@pytest.mark.skipif(not X86, reason="the switches are those of x86-64 processors")
def test_planned_motions_are_the_same_without_vector_units() -> None:
    """Many motions cost the same: none is possible. In this world it counts which of them is replaced."""
    code = """if True:
        import os
        from companion.cli.kernel_cache import use_cache
        use_cache(os.environ)
        from tests.companion.control.test_motion_controller import driven, posts
        print(driven(posts(2), 2))
    """
    told = [
        subprocess.run(
            [sys.executable, "-c", code], cwd=ROOT, env={**os.environ, **more}, capture_output=True, check=True
        )
        for more in ({}, NO_VECTORS)
    ]
    assert told[0].stdout == told[1].stdout


@pytest.mark.skipif(not X86, reason="the switches are those of x86-64 processors")
def test_without_fused_multiply_add_the_last_digits_do_differ() -> None:
    """Else the tests above would compare a machine with itself."""
    sines = "import math; print([math.sin(0.001 * n) for n in range(100_000)])"
    run = [
        subprocess.run(
            [sys.executable, "-c", sines], env={**os.environ, **more}, capture_output=True, check=True
        ).stdout
        for more in ({}, NO_FMA)
    ]
    if "fma" in Path("/proc/cpuinfo").read_text() and platform.libc_ver()[0] == "glibc":
        assert run[0] != run[1]
