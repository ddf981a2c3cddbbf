// Small computations with places, [north, east] in metres.

/** Metres between two places; NaN when one is missing. */
export function distance(a, b) {
  return a && b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : NaN;
}

/** Length of a line of places. */
export function length(line) {
  let sum = 0;
  for (let i = 1; i < line.length; i += 1) sum += distance(line[i - 1], line[i]);
  return sum;
}

/** Places that take the same room as all of these: the four corners round them where they are many. */
export function outermost(places, most = 400) {
  if (places.length <= most) return places;
  let [south, north, west, east] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const [n, e] of places) {
    [south, north] = [Math.min(south, n), Math.max(north, n)];
    [west, east] = [Math.min(west, e), Math.max(east, e)];
  }
  return [
    [south, west],
    [south, east],
    [north, west],
    [north, east],
  ];
}

/** A point of a rover's outline [forward, right] at a pose [north, east, heading]. */
export function placed([forward, right], [north, east, heading]) {
  const cos = Math.cos(heading);
  const sin = Math.sin(heading);
  return [north + forward * cos - right * sin, east + forward * sin + right * cos];
}

/** The index of the last value not above `wanted` in a growing list; -1 when all are above. */
export function lastNotAbove(values, wanted, count = values.length) {
  let low = 0;
  let high = count;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= wanted) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** An angle between two, on the shorter way. */
export function between(a, b, share) {
  const turn = Math.atan2(Math.sin(b - a), Math.cos(b - a));
  return a + turn * share;
}

/** A path that ends farther from the goal leads somewhere else first: back, to look for another way. */
const AT_GOAL_M = 3;

/** The rover may have passed so much of a path: a record keeps it for a second or so while the rover drives on. */
const PASSED_M = 5;

/** The places of the path that lie ahead of the rover. */
export function pathAhead({ pose, path }) {
  if (!pose || !path?.length) return path ?? [];
  let [nearest, at, along] = [Infinity, 0, 0];
  for (let i = 0; i < path.length && along <= PASSED_M; i += 1) {
    const far = distance(pose, path[i]);
    if (far < nearest) [nearest, at] = [far, i];
    along += distance(path[i], path[i + 1] ?? path[i]);
  }
  const [here, next] = [path[at], path[at + 1]];
  if (!next) return path.slice(at);
  const passed = (pose[0] - here[0]) * (next[0] - here[0]) + (pose[1] - here[1]) * (next[1] - here[1]) > 0;
  return path.slice(passed ? at + 1 : at);
}

/** Metres along the path that are left to the goal; NaN without a path that leads there. */
export function wayLeft(frame) {
  const { pose, path, goal } = frame ?? {};
  if (!pose || !goal || !path?.length || distance(path.at(-1), goal.place) > AT_GOAL_M) return NaN;
  return length([pose, ...pathAhead(frame)]);
}
