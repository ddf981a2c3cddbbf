"""Draws the worlds of the shipped missions: ``python missions/maps/draw.py [FOLDER]``.

100 x 50 fields of 1 m, black is an obstacle. Fields are written (x, y), x east and y north from the south-west corner,
as in missions; north is up. Start is (0, 24), target (98, 24). Every passage is at least three fields
wide. Random numbers are seeded: every run draws the same images.
"""

from __future__ import annotations

import math
import random
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

WIDTH, HEIGHT = 100, 50
START, TARGET = (0, 24), (98, 24)
GAP = 3
"""Free fields between any two obstacles, and between an obstacle and the map's edge unless it stands there."""

Mask = NDArray[np.bool_]


def open_ground() -> Mask:
    """No obstacle anywhere."""
    return np.zeros((HEIGHT, WIDTH), dtype=np.bool_)


def fill(mask: Mask, x0: int, y0: int, x1: int, y1: int, value: bool = True) -> None:
    """A rectangle from field (x0, y0) to field (x1, y1), both part of it."""
    mask[y0 : y1 + 1, x0 : x1 + 1] = value


# --- shapes placed by chance -----------------------------------------------------------------------------------------


def grown(mask: Mask, by: int) -> Mask:
    """The mask and everything within ``by`` fields of it, diagonals included."""
    padded = np.pad(mask, by)
    result = np.zeros_like(mask)
    for dy in range(2 * by + 1):
        for dx in range(2 * by + 1):
            result |= padded[dy : dy + mask.shape[0], dx : dx + mask.shape[1]]
    return result


def fits(world: Mask, stamp: Mask, x: int, y: int, gap: int = GAP) -> bool:
    """Whether a stamp with its south-west field at (x, y) keeps its distance to everything."""
    height, width = stamp.shape
    edges = (x, y, WIDTH - x - width, HEIGHT - y - height)
    if min(edges) < 0 or any(0 < edge < gap for edge in edges):
        return False
    here = open_ground()
    here[y : y + height, x : x + width] = stamp
    ends = open_ground()
    for end_x, end_y in (START, TARGET):
        ends[end_y, end_x] = True
    return not (grown(here, gap) & world).any() and not (grown(here, 5) & ends).any()


def scattered(world: Mask, stamps: Iterable[Mask], chance: random.Random, gap: int = GAP) -> Mask:
    """The world with every stamp at a place of its own."""
    for stamp in stamps:
        height, width = stamp.shape
        places = [(x, y) for x in range(WIDTH - width + 1) for y in range(HEIGHT - height + 1)]
        chance.shuffle(places)
        x, y = next(place for place in places if fits(world, stamp, *place, gap))
        world[y : y + height, x : x + width] |= stamp
    return world


def block(width: int, height: int) -> Mask:
    """A rectangle."""
    return np.ones((height, width), dtype=np.bool_)


def painted(mask: Mask, brush: int) -> Mask:
    """What a square brush of so many fields can paint without leaving the mask: no spikes, no slits."""
    height, width = mask.shape[0] - brush + 1, mask.shape[1] - brush + 1
    shifts = [(dy, dx) for dy in range(brush) for dx in range(brush)]
    corners = np.logical_and.reduce([mask[dy : dy + height, dx : dx + width] for dy, dx in shifts])
    result = np.zeros_like(mask)
    for dy, dx in shifts:
        result[dy : dy + height, dx : dx + width] |= corners
    return result


def from_rows(rows: str) -> Mask:
    """A stamp from rows of '#' and '.', top row first."""
    lines = rows.split()
    return np.array([[letter == "#" for letter in line] for line in lines], dtype=np.bool_)[::-1]


def blob(radius: float, chance: random.Random) -> Mask:
    """A boulder: a circle with a few waves round it."""
    waves = [(n, chance.uniform(0.06, 0.2) * radius, chance.uniform(0.0, 2.0 * math.pi)) for n in (2, 3, 5)]
    size = math.ceil(1.6 * radius)
    ys, xs = np.mgrid[-size : size + 1, -size : size + 1]
    angle = np.arctan2(ys, xs)
    edge = radius + sum(height * np.cos(n * angle + phase) for n, height, phase in waves)
    inside = np.hypot(xs, ys) <= edge
    smooth = ~painted(~painted(np.pad(inside, GAP), 3), GAP)
    rows, columns = np.flatnonzero(smooth.any(axis=1)), np.flatnonzero(smooth.any(axis=0))
    return smooth[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


# --- the unknown worlds ----------------------------------------------------------------------------------------------


def one_obstacle() -> Mask:
    """A single block across the straight way."""
    world = open_ground()
    fill(world, 44, 13, 55, 33)
    return world


def clutter() -> Mask:
    """22 simple obstacles."""
    chance = random.Random(22)
    sizes = [(chance.randint(3, 9), chance.randint(3, 11)) for _ in range(17)]
    world = open_ground()
    for x, y, width, height in ((12, 20, 4, 9), (28, 16, 7, 10), (47, 22, 5, 8), (63, 17, 8, 9), (81, 21, 4, 8)):
        fill(world, x, y, x + width - 1, y + height - 1)
    return scattered(world, (block(*size) for size in sorted(sizes, reverse=True)), chance)


def rooms() -> Mask:
    """The inside of a building: five by three rooms, doors three fields wide and not in line, three blind rooms."""
    world = open_ground()
    walls_x, walls_y = (7, 24, 41, 58, 75, 91), (16, 33)
    fill(world, 7, 0, 91, 0)
    fill(world, 7, 49, 91, 49)
    for x in walls_x:
        fill(world, x, 0, x, 49)
    for y in walls_y:
        fill(world, 7, y, 91, y)
    for x, y in ((7, 27), (24, 42), (41, 37), (41, 5), (58, 28), (58, 9), (75, 44), (75, 11), (91, 21)):
        fill(world, x, y, x, y + 2, False)
    for x, y in ((12, 33), (19, 16), (33, 33), (49, 33), (44, 16), (68, 33), (63, 16), (86, 33), (80, 16)):
        fill(world, x, y, x + 2, y, False)
    return world


HOOK = from_rows("""
    #########
    #########
    ##.....##
    ##.....##
    ##.....##
    .......##
    .......##
    .......##
    #########
    #########
""")
ELL = from_rows("""
    ###......
    ###......
    ###......
    ###......
    ###......
    #########
    #########
""")
TEE = from_rows("""
    ###########
    ###########
    ....###....
    ....###....
    ....###....
    ....###....
""")
CUP = from_rows("""
    ##########
    ##########
    ........##
    ........##
    ........##
    ........##
    ........##
    ........##
    ##########
    ##########
""")
STEP = from_rows("""
    .....#######
    .....#######
    .....###....
    .....###....
    ########....
    ########....
""")
CROSS = from_rows("""
    ...##...
    ...##...
    ...##...
    ########
    ########
    ...##...
    ...##...
""")


def complex_shapes() -> Mask:
    """18 obstacles of odd shapes: boulders, hooks, corners, cups."""
    chance = random.Random(4)
    world = open_ground()
    for stamp, x, y in (
        (CUP, 26, 20),
        (TEE[::-1], 45, 21),
        (CUP[:, ::-1], 62, 26),
        (HOOK[::-1], 74, 16),
        (blob(4.0, chance), 10, 21),
    ):
        world[y : y + stamp.shape[0], x : x + stamp.shape[1]] |= stamp
    pieces = [ELL, ELL[::-1, ::-1], HOOK[:, ::-1], TEE, TEE.T, STEP, STEP[:, ::-1], CROSS]
    pieces += [blob(radius, chance) for radius in (5.5, 4.5, 4.0, 3.5, 3.0)]
    pieces.sort(key=lambda stamp: -stamp.size)
    return scattered(world, pieces, chance)


def dead_end() -> Mask:
    """A cul-de-sac across the straight way: a funnel leads into it, and three baffles wind it up to its end."""
    world = open_ground()
    fill(world, 30, 35, 71, 36)
    fill(world, 30, 12, 71, 13)
    fill(world, 70, 12, 71, 36)
    for i in range(6):
        fill(world, 30 - i, 35 + i, 31 - i, 36 + i)
        fill(world, 30 - i, 12 - i, 31 - i, 13 - i)
    fill(world, 42, 20, 43, 34)
    fill(world, 52, 14, 53, 28)
    fill(world, 62, 20, 63, 34)
    return world


def sealed() -> Mask:
    """The target behind walls without a door; a few blocks on the way there."""
    world = open_ground()
    fill(world, 82, 11, 99, 37)
    fill(world, 84, 13, 98, 35, False)
    fill(world, 30, 20, 37, 30)
    fill(world, 55, 5, 60, 22)
    fill(world, 52, 33, 66, 38)
    return world


# --- the known maps of the paper's Table 1 ---------------------------------------------------------------------------


def crossing() -> Mask:
    """A broad street from west to east, three streets across it, a kiosk in the middle of the way."""
    world = open_ground()
    for x0, x1 in ((8, 18), (28, 40), (50, 62), (72, 84)):
        fill(world, x0, 4, x1, 15)
        fill(world, x0, 33, x1, 44)
    fill(world, 53, 22, 57, 26)
    return world


def ackermann() -> Mask:
    """Two walls with gaps out of line, and between them a bay of five fields, too narrow to drive a circle in."""
    world = open_ground()
    fill(world, 20, 0, 21, HEIGHT - 1)
    fill(world, 20, 31, 21, 35, value=False)
    fill(world, 40, 21, 60, 27)
    fill(world, 40, 22, 58, 26, value=False)
    fill(world, 78, 0, 79, HEIGHT - 1)
    fill(world, 78, 12, 79, 16, value=False)
    return world


def known_1() -> Mask:
    """One obstacle."""
    world = open_ground()
    fill(world, 46, 18, 53, 30)
    return world


def known_2() -> Mask:
    """Several obstacles."""
    world = open_ground()
    for x0, y0, x1, y1 in ((18, 10, 25, 29), (38, 22, 47, 41), (60, 6, 67, 27), (78, 19, 84, 36), (40, 4, 46, 13)):
        fill(world, x0, y0, x1, y1)
    return world


def known_3() -> Mask:
    """Walls with openings far to the left and right of the straight line: near the limit of 4 control points."""
    world = open_ground()
    for x, y0, y1 in ((28, 0, 30), (28, 44, 49), (64, 0, 4), (64, 18, 49), (85, 0, 14), (85, 30, 49)):
        fill(world, x, y0, x + 1, y1)
    fill(world, 50, 18, 64, 19)
    return world


def known_4() -> Mask:
    """A maze of ways four fields wide, each place reached in one way only."""
    chance = random.Random(1)
    columns, rows, pitch = 20, 10, 5
    world = np.ones((HEIGHT, WIDTH), dtype=np.bool_)

    def dig(a: tuple[int, int], b: tuple[int, int]) -> None:
        (ax, ay), (bx, by) = min(a, b), max(a, b)
        fill(world, ax * pitch, ay * pitch + 2, bx * pitch + 3, min(by * pitch + 5, HEIGHT - 1), False)

    seen, trail = {(0, 4)}, [(0, 4)]
    while trail:
        x, y = trail[-1]
        around = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
        ahead = [(i, j) for i, j in around if 0 <= i < columns and 0 <= j < rows and (i, j) not in seen]
        if not ahead:
            trail.pop()
            continue
        there = chance.choice(ahead)
        dig((x, y), there)
        seen.add(there)
        trail.append(there)
    return world


WORLDS: dict[str, Callable[[], Mask]] = {
    "one-obstacle": one_obstacle,
    "clutter": clutter,
    "rooms": rooms,
    "complex": complex_shapes,
    "dead-end": dead_end,
    "sealed": sealed,
    "crossing": crossing,
    "ackermann": ackermann,
    "known-1": known_1,
    "known-2": known_2,
    "known-3": known_3,
    "known-4": known_4,
}


def save(world: Mask, path: Path) -> None:
    """A grey PNG, north up."""
    grey = np.where(world[::-1], 0, 255).astype(np.uint8)
    Image.fromarray(grey).save(path, format="PNG", optimize=False, compress_level=9)


def main() -> None:
    """Draw all worlds beside this script, or into the folder given."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent
    for name, draw in WORLDS.items():
        save(draw(), folder / f"{name}.png")


if __name__ == "__main__":
    main()
