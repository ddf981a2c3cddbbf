// The facts of the panel: what each is called, what it says, and when it is a warning.

import { isLost } from "viewer/freshness.js";
import { distance, wayLeft } from "viewer/geometry.js";
import { heading, lasting, metres, number, turning, UNKNOWN } from "viewer/words.js";

const OLD_HEARTBEAT_S = 3;
const LOST_HEARTBEAT_S = 6;
const SLOW_HZ = 1;
const LOW_PERCENT = 20;

/** Facts that say nothing any more when it is not known where the rover is. */
export const OF_PLACE = new Set(["Goal", "Setpoint", "Position"]);

/** The three large numbers: [name, value, unit]. At the end of a run there is no speed any more, and perhaps no goal. */
export function readouts(frame) {
  const mode = ["mode", frame?.mode ?? UNKNOWN, ""];
  const far = howFar(frame);
  if (frame?.state === "ended") return far[1] === UNKNOWN ? [mode] : [far, mode];
  return [["speed", number(Math.abs(frame?.speed ?? NaN)), "m/s"], far, mode];
}

// To the goal; of a simulator, which knows none, how far the rover has come.
function howFar(frame) {
  if (Number.isFinite(frame?.driven_m)) return ["driven", ...inMetres(frame.driven_m)];
  const rest = wayLeft(frame);
  if (Number.isFinite(rest)) return ["along path", ...inMetres(rest)];
  return frame?.goal ? ["straight", ...inMetres(distance(frame.pose, frame.goal.place))] : ["to goal", UNKNOWN, ""];
}

function inMetres(far) {
  return [metres(far).replace(/ .*/, ""), far >= 9999.5 ? "km" : "m"];
}

/** Rows of [name, value, level]; the level is null, "warning" or "error". */
export function facts(frame) {
  if (!frame) return [];
  const { rates = {}, figures = {} } = frame;
  return [
    ["Driven by", frame.drives ?? UNKNOWN, null],
    ["Armed", yesNo(frame.armed), null],
    ["Goal", goalOf(frame), null],
    ["Setpoint", setpointOf(frame), null],
    ["Heading", frame.pose ? `${heading(frame.pose[2])}, ${turning(frame.turn ?? 0)}` : UNKNOWN, null],
    ["Link", linkOf(frame, rates, figures), linkLevel(frame, rates)],
    ["Position", rateOf(rates.position), rateLevel(rates.position)],
    ["Range sensor", rateOf(rates.range), rateLevel(rates.range)],
    ["GPS", gpsOf(frame.gps), gpsLevel(frame.gps)],
    ["Battery", batteryOf(frame.battery), batteryLevel(frame.battery)],
    ["Guard", { true: "on guard", false: "none heard" }[frame.guard] ?? "not asked", null],
    ["Collisions", frame.contacts ?? UNKNOWN, frame.contacts > 0 ? "error" : null],
    ["Decision", frame.decision ?? UNKNOWN, null],
    ["Tick", Number.isFinite(figures.tick_ms) ? `${number(figures.tick_ms)} ms` : UNKNOWN, null],
  ];
}

/** The same of a simulator, which knows its rover but neither goals nor decisions; and who is connected. */
export function trueFacts(frame) {
  if (!frame) return [];
  const links = frame.rates?.links ?? [];
  return [
    ["Driven by", frame.drives ?? UNKNOWN, null],
    ["Armed", yesNo(frame.armed), null],
    ["Heads for", goalOf(frame), null],
    ["Heading", frame.pose ? `${heading(frame.pose[2])}, ${turning(frame.turn ?? 0)}` : UNKNOWN, null],
    ["Driven", metres(frame.driven_m), null],
    ["Clearance", clearanceOf(frame.figures?.clearance_m), null],
    ["GPS", gpsOf(frame.gps), gpsLevel(frame.gps)],
    ["Battery", batteryOf(frame.battery), batteryLevel(frame.battery)],
    ["Collisions", frame.contacts ?? UNKNOWN, frame.contacts > 0 ? "error" : null],
    ...links.map((link) => [link.name, packetsOf(link), link.heard ? null : "warning"]),
  ];
}

function packetsOf(link) {
  const out = `${number(link.out, 0)} sent a second`;
  return link.heard ? `${number(link.in, 0)} heard, ${out}` : `nobody heard, ${out}`;
}

/** Farther than five metres it is not looked for. */
function clearanceOf(clear) {
  return clear >= 5 ? "5 m or more" : `${number(clear, 2)} m`;
}

function gpsLevel(gps) {
  return gps && /no|none|1d|2d/i.test(gps.fix ?? "no") ? "warning" : null;
}

function batteryLevel(battery) {
  return battery?.percent < LOW_PERCENT ? "warning" : null;
}

function yesNo(value) {
  return value === true ? "yes" : value === false ? "no" : UNKNOWN;
}

function goalOf(frame) {
  if (!frame.goal) return "none";
  return frame.pose
    ? `${frame.goal.name}, ${metres(distance(frame.pose, frame.goal.place))} away`
    : frame.goal.name;
}

function setpointOf({ setpoint, pose }) {
  if (!setpoint) return "none";
  if (setpoint.kind === "position") return `position, ${metres(distance(pose, setpoint.place))} away`;
  if (setpoint.kind === "velocity") return `${number(setpoint.speed, 2)} m/s, ${turning(setpoint.turn)}`;
  return setpoint.kind === "heading" ? `turn to ${heading(setpoint.heading)}` : setpoint.kind;
}

function linkOf(frame, rates, figures) {
  const age = rates.heartbeat_age_s;
  if (age === undefined) return UNKNOWN;
  if (!Number.isFinite(age)) return "no heartbeat yet";
  if (age > OLD_HEARTBEAT_S) return `last heartbeat ${lasting(age)} ago`;
  if (isLost(frame)) return "heartbeats, but no position";
  return Number.isFinite(figures.latency_ms) ? `good, ${number(figures.latency_ms, 0)} ms` : "good";
}

function linkLevel(frame, { heartbeat_age_s: age }) {
  if (age === undefined) return null; // this source does not tell it
  if (!Number.isFinite(age)) return "warning";
  if (age > LOST_HEARTBEAT_S) return "error";
  return age > OLD_HEARTBEAT_S || isLost(frame) ? "warning" : null;
}

function rateOf(rate) {
  return Number.isFinite(rate) ? `${number(rate)} a second` : UNKNOWN;
}

function rateLevel(rate) {
  return Number.isFinite(rate) && rate < SLOW_HZ ? "warning" : null;
}

function gpsOf(gps) {
  if (!gps) return UNKNOWN;
  return gps.satellites === null || gps.satellites === undefined ? gps.fix : `${gps.fix}, ${gps.satellites} satellites`;
}

function batteryOf(battery) {
  if (!battery) return UNKNOWN;
  const known = [
    [battery.percent, "%", 0],
    [battery.volts, "V", 1],
  ].filter(([value]) => Number.isFinite(value));
  return known.map(([value, unit, digits]) => `${number(value, digits)} ${unit}`).join(", ") || UNKNOWN;
}
