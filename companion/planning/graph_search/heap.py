"""A priority queue whose priorities may change: a binary heap that knows where each of its fields is. Compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Fields = NDArray[np.int32]
Keys = NDArray[np.float64]


class Queue(NamedTuple):
    """Waiting fields in the order of their keys.

    ``heap``: how many fields wait, then their numbers; ``heap[1]`` is the first to come out. ``place``: for each field
    its index in the heap, 0 when it does not wait. ``keys``: two numbers for each field; the smaller first number comes
    out first, of equal ones the smaller second. The arrays begin as zeros and have room for every field, so they never
    grow.
    """

    heap: Fields
    place: Fields
    keys: Keys


def empty_queue(fields: int) -> Queue:
    """A queue with room for so many fields. numpy's zeros come from the system only when they are used."""
    return Queue(np.zeros(fields + 1, np.int32), np.zeros(fields, np.int32), np.zeros((fields, 2)))


@njit(cache=True, nogil=True)
def before(keys: Keys, a: int, b: int) -> bool:
    """Whether field a comes out before field b."""
    return bool(keys[a, 0] < keys[b, 0] or (keys[a, 0] == keys[b, 0] and keys[a, 1] < keys[b, 1]))


@njit(cache=True, nogil=True)
def _sift(heap: Fields, place: Fields, keys: Keys, at: int) -> None:
    """Move the field at this index of the heap up or down to where its keys belong."""
    field, last = heap[at], heap[0]
    while at > 1 and before(keys, field, heap[at >> 1]):
        above = at >> 1
        heap[at] = heap[above]
        place[heap[at]] = at
        at = above
    while True:
        below = 2 * at
        if below < last and before(keys, heap[below + 1], heap[below]):
            below += 1
        if below > last or not before(keys, heap[below], field):
            break
        heap[at] = heap[below]
        place[heap[at]] = at
        at = below
    heap[at] = field
    place[field] = at


@njit(cache=True, nogil=True)
def put(queue: Queue, field: int, first: float, second: float) -> None:
    """Add the field with these keys or, if it waits already, change its keys."""
    heap, place, keys = queue
    keys[field, 0], keys[field, 1] = first, second
    at = place[field]
    if at == 0:
        heap[0] += 1
        at = heap[0]
        heap[at] = field
    _sift(heap, place, keys, at)


@njit(cache=True, nogil=True)
def take_out(queue: Queue, field: int) -> None:
    """Remove the field, if it waits."""
    heap, place, keys = queue
    at, last = place[field], heap[0]
    if at == 0:
        return
    place[field] = 0
    heap[0] = last - 1
    if at < last:
        heap[at] = heap[last]
        _sift(heap, place, keys, at)
