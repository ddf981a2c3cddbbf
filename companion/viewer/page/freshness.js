// How old what the vehicle told is, by a frame's own figures: the same live and in a record.

import { lasting } from "viewer/words.js";

/** The autopilot's heartbeat comes once a second. Without one for as long as this, its data is old. */
const SILENT_S = 3.5;
/** Positions come several times a second. Without one for as long as this, place and speed are old. */
const OLD_POSITION_S = 1.5;

/** That the autopilot is silent, in words; an empty text if it is not, and after the end of the run. */
export function silence(frame) {
  const heartbeat = frame?.rates?.heartbeat_age_s;
  return frame?.state !== "ended" && heartbeat > SILENT_S ? `Autopilot silent for ${lasting(heartbeat)}` : "";
}

/** Whether the place is old. */
export function isLost(frame) {
  return frame?.state !== "ended" && frame?.rates?.position_age_s > OLD_POSITION_S;
}
