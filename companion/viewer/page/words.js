// Numbers, times and places as a person reads them. What is not known is a dash, never a zero.

export const UNKNOWN = "–";

/** A number with a fixed count of digits after the point. */
export function number(value, digits = 1) {
  if (!Number.isFinite(value)) return UNKNOWN;
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text; // never "-0.0"
}

/** A distance: centimetres matter near, not far. */
export function metres(value) {
  if (!Number.isFinite(value)) return UNKNOWN;
  if (value >= 9999.5) return `${(value / 1000).toFixed(1)} km`;
  return value < 99.95 ? `${value.toFixed(1)} m` : `${value.toFixed(0)} m`;
}

/** The time of day at `t` in UTC, as records and replays count, where it is known; else the time since the beginning. */
export function clock(t, scene) {
  if (!Number.isFinite(t)) return UNKNOWN;
  if (Number.isFinite(scene?.began_unix_s)) {
    const date = new Date((scene.began_unix_s + t) * 1000);
    return [date.getUTCHours(), date.getUTCMinutes(), date.getUTCSeconds()].map(two).join(":");
  }
  return elapsed(t);
}

/** As `clock`, and what clock it is. */
export function namedClock(t, scene) {
  return Number.isFinite(t) && Number.isFinite(scene?.began_unix_s) ? `${clock(t, scene)} UTC` : clock(t, scene);
}

/** A time since the beginning: 1:05 or 1:02:05. */
export function elapsed(t) {
  const whole = Math.max(0, Math.floor(t));
  const hours = Math.floor(whole / 3600);
  const minutes = Math.floor(whole / 60) % 60;
  return hours ? `${hours}:${two(minutes)}:${two(whole % 60)}` : `${minutes}:${two(whole % 60)}`;
}

/** A duration: 4 s, 3 min, 2 h. */
export function lasting(seconds) {
  if (seconds < 100) return `${Math.floor(seconds)} s`;
  return seconds < 6000 ? `${Math.floor(seconds / 60)} min` : `${Math.floor(seconds / 3600)} h`;
}

/** A place as steps from the frame's zero. */
export function place([north, east]) {
  const first = `${number(Math.abs(north))} m ${north < 0 ? "south" : "north"}`;
  return `${first}, ${number(Math.abs(east))} m ${east < 0 ? "west" : "east"}`;
}

/** Radians a second, clockwise, as degrees with the side. */
export function turning(rate) {
  const degrees = Math.round((Math.abs(rate) * 180) / Math.PI);
  return degrees === 0 ? "straight" : `${degrees}°/s ${rate > 0 ? "right" : "left"}`;
}

/** A heading in degrees, 000 to 359. */
export function heading(radians) {
  const degrees = Math.round((radians * 180) / Math.PI) % 360;
  return `${String((degrees + 360) % 360).padStart(3, "0")}°`;
}

/** A name for the map, cut in the middle if it is long: its end may be what tells it from others. */
export function short(name, most = 28) {
  const letters = [...name];
  if (letters.length <= most) return name;
  const tail = Math.floor(most / 3);
  return `${letters.slice(0, most - tail - 1).join("").trimEnd()}…${letters.slice(-tail).join("").trimStart()}`;
}

/** The first letter large: lines come in small letters. */
export function sentence(text) {
  // Word joiners: an option such as --arm is not to be broken.
  return text ? text[0].toUpperCase() + text.slice(1).replaceAll("--", "-\u2060-\u2060") : "";
}

function two(value) {
  return String(value).padStart(2, "0");
}
