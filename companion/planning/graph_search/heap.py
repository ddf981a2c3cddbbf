"""A priority queue of fields whose priority may change: a binary heap that knows where each field is. Compiled.

``heap[:size]`` has the waiting fields' numbers, ``place`` has for each field of the map where it is in the heap, plus 1 (0: not waiting), and
``keys`` has two numbers for each field: the smaller first number comes first, and of equal ones the smaller second. Every function
returns the new size. All arrays may begin as zeros, and each has room for every field, so none ever grows.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Fields = NDArray[np.int32]
Keys = NDArray[np.float64]


@njit(cache=True, nogil=True)
def before(keys: Keys, a: int, b: int) -> bool:
    """Whether field a comes out before field b."""
    return bool(keys[a, 0] < keys[b, 0] or (keys[a, 0] == keys[b, 0] and keys[a, 1] < keys[b, 1]))


@njit(cache=True, nogil=True)
def _settle(heap: Fields, place: Fields, keys: Keys, size: int, at: int) -> None:
    """Move the field at this place of the heap up or down to where its keys belong."""
    field = heap[at]
    while at > 0 and before(keys, field, heap[(at - 1) >> 1]):
        above = (at - 1) >> 1
        heap[at] = heap[above]
        place[heap[at]] = at + 1
        at = above
    while True:
        below = 2 * at + 1
        if below + 1 < size and before(keys, heap[below + 1], heap[below]):
            below += 1
        if below >= size or not before(keys, heap[below], field):
            break
        heap[at] = heap[below]
        place[heap[at]] = at + 1
        at = below
    heap[at] = field
    place[field] = at + 1


@njit(cache=True, nogil=True)
def put(heap: Fields, place: Fields, keys: Keys, size: int, field: int, first: float, second: float) -> int:
    """Let the field wait with these keys, whether it waits already or not."""
    keys[field, 0], keys[field, 1] = first, second
    at = place[field] - 1
    if at < 0:
        at = size
        heap[at] = field
        size += 1
    _settle(heap, place, keys, size, at)
    return size


@njit(cache=True, nogil=True)
def take_out(heap: Fields, place: Fields, keys: Keys, size: int, field: int) -> int:
    """Let the field wait no longer, if it does."""
    at = place[field] - 1
    if at < 0:
        return size
    place[field] = 0
    size -= 1
    if at < size:
        heap[at] = heap[size]
        _settle(heap, place, keys, size, at)
    return size
