"""Random numbers inside compiled kernels: splitmix64 with its state in an array of one word that the caller owns."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.random import Generator
from numpy.typing import NDArray

State = NDArray[np.uint64]

_STEP = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_30, _27, _31, _11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)


def draw_seed(rng: Generator) -> int:
    """A seed for one kernel call, of 63 bits, so that the compiler sees the same type for every value."""
    return int(rng.bit_generator.random_raw()) >> 1


@njit(cache=True, nogil=True)
def seeded(seed: int) -> State:
    """The initial state for this seed."""
    state = np.empty(1, np.uint64)
    state[0] = np.uint64(seed)
    return state


@njit(cache=True, nogil=True)
def uniform(state: State) -> float:
    """The next number in [0, 1)."""
    state[0] += _STEP
    z = state[0]
    z = (z ^ (z >> _30)) * _MIX_1
    z = (z ^ (z >> _27)) * _MIX_2
    # A signed number becomes a float in one instruction, and 53 bits are never negative.
    return float(np.int64((z ^ (z >> _31)) >> _11)) * (1.0 / 9007199254740992.0)


@njit(cache=True, nogil=True)
def whole(state: State, low: int, high: int) -> int:
    """The next integer in low..high, both included; ``low`` if the range is empty."""
    return low + int(uniform(state) * max(high - low + 1, 1))
