"""Checks of an autopilot for what would stop a mission: presence, readiness, range sensors, parameters.

Pure functions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from companion.diagnosis.finding import Finding, Level, to_set
from companion.vehicle.events import RoverMode
from companion.vehicle.gps_fix import NEEDED, GpsFix
from companion.vehicle.guard import IN_TIME_S
from companion.vehicle.motion_limits import CRUISE_M_S, LIMITS, THROTTLE_SCALE, full_throttle_m_s
from companion.vehicle.recommended_parameters import RECOMMENDED_PARAMETERS
from companion.vehicle.state import EKF_CONST_POSITION, EKF_POSITION, EkfQuantity
from companion.vehicle.survey import Survey
from companion.vehicle.wanted_parameters import S_CURVES, wanted_parameters

FIRMWARE = (4, 7)
"""The version of ArduRover that this was written for and measured with."""
ROVER, BOAT = 10, 11
ARDUPILOT = 3
LOST_SHARE = 0.1
DAMAGED_SHARE, SOME_BYTES = 0.05, 500
UNLIKELY = 4.0
"""A rover is not driven at less than a fourth of what it could."""
EKF_UNINITIALISED, EKF_GPS_GLITCH = 1024, 32768
MAVLINK_SOURCE = 2
"""PRX1_TYPE that takes OBSTACLE_DISTANCE."""
BODY_FRD = 12
"""The MAV_FRAME of obstacle points."""
NEAR_M, SHORT_M, FAR_M, SLOW_HZ = 0.6, 2.0, 120.0, 3.0
"""Limits of unusual range sensors: minimum above NEAR_M, maximum below SHORT_M or above FAR_M, rate below SLOW_HZ."""
ARMING_COMPLAINTS = ("PreArm:", "Arm:")
"""How ArduPilot's texts about arming begin; MAVLink has no other sign of what a STATUSTEXT is about."""
RADIUS_M = 2.0
STICKS = {"RCMAP_ROLL": 1.0, "RCMAP_THROTTLE": 3.0}
"""The channels that the companion reads."""
STATIONS = ("MAV_GCS_SYSID", "SYSID_MYGCS")
"""The same parameter in 4.7 and in older versions."""
SCRIPTS = ("SCR_ENABLE", "SCR_USER1")
"""A board that runs no scripts does not have them."""
GUARD_LEAST_MS = 200.0
"""See companion/vehicle/guard.lua."""
FAILSAFES = {"FS_ACTION": "A failsafe", "FS_EKF_ACTION": "A lost position"}
PARAMETERS = (
    "OA_TYPE",
    "AVOID_ENABLE",
    "GUID_OPTIONS",
    "GUID_TIMEOUT",
    "WP_RADIUS",
    "WP_JERK",
    "PRX1_TYPE",
    "RNGFND1_TYPE",
    "FS_GCS_ENABLE",
    *FAILSAFES,
    "FENCE_ENABLE",
    *dict.fromkeys((*LIMITS, *THROTTLE_SCALE)),
    *STICKS,
    *STATIONS,
    *SCRIPTS,
)
"""The parameters that the checks need."""


# Who is there ----------------------------------------------------------------------------------------------------


def nobody(seen: Survey) -> Iterator[Finding]:
    """What was heard if no rover was."""
    strangers = [one for one in seen.autopilots if (one.make, one.kind) not in ((ARDUPILOT, ROVER), (ARDUPILOT, BOAT))]
    if seen.signing:
        yield Finding("signing", Level.STOP, seen.signing, seen.signing_remedy)
    elif strangers:
        one = strangers[0]
        says = f"System {one.system} is a vehicle of type {one.kind} (autopilot {one.make}), no ArduPilot rover."
        yield Finding("not-a-rover", Level.STOP, says, "connect to the rover")
    elif seen.packets:
        says = f"MAVLink is heard on {seen.place}, but no autopilot."
        yield Finding(
            "no-autopilot", Level.STOP, says, "look which of the autopilot's ports this is, and whether it sends there"
        )
    else:
        says = f"Nothing is heard on {seen.place}."
        remedy = (
            "look at power, cable, port and baud rate, and that SERIALn_PROTOCOL of that port is 2"
            if _is_serial(seen)
            else "look at power and network, and that the rover's side sends to this address"
        )
        yield Finding("no-autopilot", Level.STOP, says, remedy)


def _is_serial(seen: Survey) -> bool:
    """Whether the link has a baud rate."""
    return seen.place.startswith("serial:")


def others(seen: Survey) -> Iterator[Finding]:
    """Other companions and autopilots on this link."""
    if seen.companion_heard:
        says = f"Somebody speaks as component {seen.component} already: a companion that is running?"
        yield Finding("two-companions", Level.STOP, says, "stop it before another one drives this rover")
    systems = sorted(one.system for one in seen.autopilots)
    if len(systems) > 1:
        ids = ", ".join(map(str, systems))
        says = f"Autopilots with the system ids {ids} are heard; a run takes the first rover it hears."
        remedy = "leave it so for vehicles that announce themselves; give another rover its own line, or switch it off"
        yield Finding("several-autopilots", Level.WARN, says, remedy)
    if seen.rover_heard and seen.signing:
        yield Finding("signing", Level.WARN, f"{seen.signing}.", "see docs/signing.md")


def port(seen: Survey) -> Iterator[Finding]:
    """Whether another program takes bytes from this port, or something else damages them."""
    if seen.rivals:
        who = " and ".join(seen.rivals)
        says = f"{who} has the same port open: each of the programs takes bytes away from the others."
        yield Finding("port-shared", Level.STOP, says, "stop it, or let a router share the port: docs/ports.md")
    elif seen.read_bytes >= SOME_BYTES and seen.bad_bytes > DAMAGED_SHARE * seen.read_bytes:
        share = round(100.0 * seen.bad_bytes / seen.read_bytes)
        says = f"{share} % of the {seen.read_bytes} bytes on {seen.place} belong to no valid packet."
        remedy = (
            "look at baud rate and cable, and as root whether another program has the port open (docs/ports.md)"
            if _is_serial(seen)
            else "look what else sends there, and at the line behind it"
        )
        yield Finding("port-damaged", Level.WARN, says, remedy)


def identity(seen: Survey) -> Iterator[Finding]:
    """Whether ids are distinct and packets arrive."""
    station = station_of(seen)
    if station is not None and int(station[1]) == seen.system:
        says = (
            f"The autopilot and its ground station both have the system id {seen.system}: "
            "the failsafe would watch the companion."
        )
        yield to_set("system-ids", Level.STOP, says, *station, 255.0)
    missing = [name for name in seen.asked if name not in seen.parameters]
    if len(missing) == len(seen.asked) > 0:
        says = "The autopilot tells none of its parameters."
        yield Finding("no-parameters", Level.WARN, says, "look whether it is asked through a radio that drops much")
    elif unheard := _unheard(missing, seen):
        says = f"Not told, and so not looked at: {', '.join(unheard)}."
        yield Finding("parameters-unheard", Level.WARN, says, "ask again, over a line that drops less")
    elif seen.packets and seen.lost > LOST_SHARE * seen.packets:
        says = f"{seen.lost} packets of the autopilot were lost, {seen.packets} came."
        better = "a faster baud rate, a better cable" if _is_serial(seen) else "a better radio or network"
        yield Finding("packets-lost", Level.WARN, says, f"{better}, or fewer messages on this line")


def _unheard(missing: Sequence[str], seen: Survey) -> list[str]:
    """The parameters that should have been answered: not every board has those of scripts; of two names, it has one."""
    station = station_of(seen) is not None
    missing = [name for name in missing if name not in SCRIPTS]
    return [name for name in missing if name not in STATIONS or (not station and name == STATIONS[0])]


def firmware(seen: Survey) -> Iterator[Finding]:
    """Whether the firmware is new enough."""
    if seen.version is None:
        yield Finding(
            "firmware", Level.NOTE, "The autopilot does not tell its version.", "this was written for ArduRover 4.7"
        )
    elif seen.version[:2] < FIRMWARE:
        told = ".".join(map(str, seen.version))
        says = f"ArduRover {told}; this was written for 4.7, and some parameters had other names before."
        yield Finding("firmware", Level.WARN, says, "install ArduRover 4.7 or later")


# Whether the rover could set off now -------------------------------------------------------------------------------


def mode_of(seen: Survey) -> Iterator[Finding]:
    """Whether somebody drives the rover already."""
    beat = seen.vehicle.heartbeat
    if beat is None or not beat.armed:
        return
    if beat.mode in (RoverMode.GUIDED, RoverMode.HOLD):
        yield Finding(
            "armed", Level.NOTE, "The rover is armed: a run would drive off at once.", "disarm it if it should not"
        )
    else:
        mode = RoverMode(beat.mode).name if beat.mode in list(RoverMode) else str(beat.mode)
        says = f"The rover is armed in mode {mode}: somebody is driving, and a run waits."
        yield Finding("mode", Level.STOP, says, "set HOLD or GUIDED, or disarm")


def position(seen: Survey) -> Iterator[Finding]:
    """Whether the autopilot has a position."""
    vehicle = seen.vehicle
    if vehicle.ekf is None:
        says, remedy = "EKF_STATUS_REPORT does not come.", "look at the rates of this port"
        yield Finding("ekf", Level.STOP, says, remedy)
    elif vehicle.ekf_lacks is EkfQuantity.POSITION:
        flags = vehicle.ekf.flags
        why = "it only knows where it began" if flags & EKF_CONST_POSITION else "it has none"
        why = (
            "it has just been switched on"
            if flags & EKF_UNINITIALISED or not flags & (EKF_POSITION | EKF_CONST_POSITION)
            else why
        )
        why = "GPS jumps" if flags & EKF_GPS_GLITCH else why
        says = f"The EKF has no position: {why}."
        yield Finding(
            "ekf", Level.STOP, says, "wait for GPS under open sky (about 45 s), or set up another source of position"
        )
    elif vehicle.ekf_lacks is not None:
        says = f"The EKF has no {vehicle.ekf_lacks.value}."
        yield Finding(
            "ekf", Level.STOP, says, "let the rover stand until it has, and look at the messages of the autopilot"
        )
    if vehicle.origin is None or vehicle.home is None:
        missing = " and ".join(
            name for name, place in (("origin", vehicle.origin), ("home", vehicle.home)) if place is None
        )
        says = f"The autopilot has no {missing} yet."
        yield Finding("origin", Level.STOP, says, "wait for GPS, or set the EKF origin at the ground station's map")
    if vehicle.position is None and vehicle.ekf_ok:
        yield Finding("no-position", Level.STOP, "LOCAL_POSITION_NED does not come.", "look at the rates of this port")


def gps(seen: Survey, gps_fix: str) -> Iterator[Finding]:
    """Whether the GPS fix is the one that ``safety.gps_fix`` asks for."""
    needed, told = NEEDED.get(gps_fix), seen.vehicle.gps
    if needed is not None and told is None:
        says = (
            f"The GPS fix is not told (GPS_RAW_INT does not come); safety.gps_fix asks for {gps_fix}, and a run waits."
        )
        yield Finding("gps-fix", Level.STOP, says, "look at the GPS and at the rates of this port")
    elif needed is not None and told is not None and told.fix < needed:
        says = f"The GPS fix is {told.fix.text}; safety.gps_fix asks for {gps_fix}, and a run waits."
        better = "corrections (RTCM) that reach the receiver, and " if needed >= GpsFix.RTK_FLOAT else ""
        remedy = f"see to {better}open sky; or ask for less in the settings"
        yield Finding("gps-fix", Level.STOP, says, remedy)


def arming(seen: Survey) -> Iterator[Finding]:
    """Whether it could be armed: earlier complaints do not count once its own checks pass."""
    beat, prearm = seen.vehicle.heartbeat, seen.vehicle.prearm
    complaints = [text for text in seen.texts if text.startswith(ARMING_COMPLAINTS)]
    refuses = bool(complaints) if prearm is None else not prearm.ok
    if refuses and not (beat is not None and beat.armed):
        reasons = "; ".join(text.partition(": ")[2] for text in complaints) or "it does not say why"
        says = f"The autopilot would not arm: {reasons}."
        yield Finding("pre-arm", Level.STOP, says, "do as the message says; leave its checks switched on")
    for text in seen.texts:
        if text not in complaints:
            yield Finding("text", Level.NOTE, f"The autopilot says: {text}", "")


def rates(seen: Survey) -> Iterator[Finding]:
    """Messages whose rate is too low. Without a position of the EKF, none can be sent."""
    no_position = seen.vehicle.ekf is not None and seen.vehicle.ekf_lacks is EkfQuantity.POSITION
    for message in seen.slow:
        if message.name == "LOCAL_POSITION_NED" and no_position:
            continue
        vital = message.name in ("LOCAL_POSITION_NED", "ATTITUDE", "EKF_STATUS_REPORT") and message.measured_hz < 1.5
        says = f"{message.name} comes at {message.measured_hz:.1f} Hz though {message.wanted_hz:g} Hz were asked for."
        faster = "a faster baud rate (115200)" if _is_serial(seen) else "a faster radio or network"
        remedy = f"{faster}, or keep ground stations from setting their own rates on this port"
        yield Finding("rate", Level.STOP if vital else Level.WARN, says, remedy)


# Range sensors ---------------------------------------------------------------------------------------------------


def ranges(seen: Survey) -> Iterator[Finding]:
    """Range sensors and their data."""
    sensors = [one for one in seen.sources if not one.sector]
    if seen.parameters.get("PRX1_TYPE") == MAVLINK_SOURCE:
        says = "The autopilot sends obstacles that it receives back as its own sensors (an echo); they are left out."
        yield to_set("echo", Level.NOTE, says, "PRX1_TYPE", MAVLINK_SOURCE, 0.0)
    if seen.wired and not seen.sources:
        return
    if not seen.sources and seen.vehicle.scan is None:
        says = "No range data: the rover would be blind, and a run waits."
        remedy = (
            "give a lidar on a serial port of this computer with --lidar, or set RNGFND1_TYPE for a sensor that is "
            "wired to the autopilot"
        )
        value = seen.parameters.get("RNGFND1_TYPE")
        yield Finding("no-range-sensor", Level.STOP, says, remedy, "RNGFND1_TYPE" if value == 0.0 else "", value)
        return
    if not sensors and seen.vehicle.scan is not None:
        says = "Range data comes only as the autopilot's sectors or as RANGEFINDER, which are coarse."
        yield Finding("coarse-range", Level.WARN, says, "wire the lidar to this computer (--lidar)")
    if seen.vehicle.scan_ahead is None and not seen.wired:
        says = "No range sensor tells what is straight ahead (within 20 degrees)."
        yield Finding("not-ahead", Level.STOP, says, "turn a sensor forward: RNGFNDn_ORIENT 0")
    for one in sensors:
        name = f"{one.message} {one.sensor} of component {one.component}"
        yield from _limits(name, one.min_m, one.max_m)
        if one.frame not in (None, BODY_FRD):
            says = f"{name} is in frame {one.frame}: such points are not used."
            yield Finding("points-frame", Level.WARN, says, "have its driver send MAV_FRAME_BODY_FRD (12)")
        elif one.blind:
            yield Finding(
                "range-unknown",
                Level.WARN,
                f"{name} knows nothing: all readings are invalid.",
                "look at the sensor; of points, at their heights (docs/depth-cameras.md)",
            )
        elif one.rate_hz < SLOW_HZ:
            says = f"{name} comes at {one.rate_hz:.1f} Hz; after a second without, the rover stops."
            yield Finding("range-slow", Level.WARN, says, "have it send at 5 to 15 Hz")


def _limits(name: str, min_m: float, max_m: float) -> Iterator[Finding]:
    told = f"{name} says that it sees from {min_m:g} m to {max_m:g} m"
    if max_m <= min_m:
        yield Finding(
            "range-limits",
            Level.STOP,
            f"{told}: it is not used.",
            "set RNGFNDn_MIN and RNGFNDn_MAX as in its data sheet",
        )
    elif max_m < SHORT_M:
        yield Finding(
            "range-limits", Level.WARN, f"{told}: the rover will creep.", "set RNGFNDn_MAX as in its data sheet"
        )
    elif max_m > FAR_M:
        yield Finding(
            "range-limits", Level.WARN, f"{told}: more than such sensors do.", "set RNGFNDn_MAX as in its data sheet"
        )
    elif min_m > NEAR_M:
        yield Finding(
            "range-limits", Level.WARN, f"{told}: blind for what is near.", "set RNGFNDn_MIN as in its data sheet"
        )


# Parameters ------------------------------------------------------------------------------------------------------


def avoidance(seen: Survey) -> Iterator[Finding]:
    """Whether the autopilot's own obstacle avoidance is on."""
    paths, simple = seen.parameters.get("OA_TYPE", 0.0), seen.parameters.get("AVOID_ENABLE", 0.0)
    if paths:
        says = "The autopilot plans ways round obstacles itself, and ignores new targets meanwhile."
        yield to_set("oa-type", Level.STOP, says, "OA_TYPE", paths, RECOMMENDED_PARAMETERS["OA_TYPE"])
    if simple:
        says = "The autopilot's simple avoidance creeps towards obstacles and stays there, without a word."
        yield to_set("avoid-enable", Level.STOP, says, "AVOID_ENABLE", simple, RECOMMENDED_PARAMETERS["AVOID_ENABLE"])


def guided(seen: Survey) -> Iterator[Finding]:
    """How the autopilot follows guided targets."""
    options = int(seen.parameters.get("GUID_OPTIONS", 0.0))
    if options & S_CURVES:
        says = "With S-curves every repeated target nearly stops the rover."
        yield to_set("guid-options", Level.STOP, says, "GUID_OPTIONS", float(options), float(options & ~S_CURVES))
    timeout_s = seen.parameters.get("GUID_TIMEOUT", 3.0)
    if timeout_s > 3.0:
        says = f"A velocity goes on for {timeout_s:g} s after the companion has fallen silent."
        yield to_set("guid-timeout", Level.WARN, says, "GUID_TIMEOUT", timeout_s, 3.0)
    radius_m = seen.parameters.get("WP_RADIUS", 1.0)
    if radius_m > RADIUS_M:
        says = f"The autopilot takes a target for reached {radius_m:g} m before it, and cuts corners so."
        yield to_set("wp-radius", Level.WARN, says, "WP_RADIUS", radius_m, RECOMMENDED_PARAMETERS["WP_RADIUS"])
    wanted_m_s3 = RECOMMENDED_PARAMETERS["WP_JERK"]
    jerk_m_s3 = seen.parameters.get("WP_JERK", wanted_m_s3)
    if jerk_m_s3 != wanted_m_s3:
        how = "slowly" if jerk_m_s3 < wanted_m_s3 else "abruptly"
        says = f"The rover begins and ends its way to a target {how}; the companion was tried with {wanted_m_s3:g}."
        yield to_set("wp-jerk", Level.NOTE, says, "WP_JERK", jerk_m_s3, wanted_m_s3)
    yield from throttle(seen)
    for one in wanted_parameters(0.0):
        if one.name in FAILSAFES and not one.accepts(action := seen.parameters.get(one.name, one.value)):
            says = f"{FAILSAFES[one.name]} ends otherwise than in HOLD: it may drive through whatever is in the way."
            yield to_set("failsafe-action", Level.WARN, says, one.name, action, one.value)
    if seen.parameters.get("WP_SPEED") == 0.0:
        yield to_set("wp-speed", Level.WARN, "Guided speed is left to CRUISE_SPEED.", "WP_SPEED", 0.0, 2.0)


def throttle(seen: Survey) -> Iterator[Finding]:
    """Whether the throttle's scale can be right: by it the companion notices ground that holds the rover."""
    known = {name: seen.parameters[name] for name in THROTTLE_SCALE if name in seen.parameters}
    wanted_m_s = seen.parameters.get("WP_SPEED", 0.0) or known.get("CRUISE_SPEED", 0.0)
    if len(known) < len(THROTTLE_SCALE) or wanted_m_s <= 0.0:
        return
    full_m_s = full_throttle_m_s(known)
    most_m_s = UNLIKELY * max(wanted_m_s, CRUISE_M_S)  # a rover may be told to drive slowly, as on its first drive
    if min(known.values()) > 0.0 and wanted_m_s <= full_m_s <= most_m_s:
        return
    says = (
        f"By CRUISE_SPEED {known['CRUISE_SPEED']:g} the rover drives {full_m_s:.1f} m/s with full throttle. If it does "
        "not, ground that holds it back is not noticed, or firm ground is taken for such and it drives slowly."
    )
    remedy = "set both to what it drives on firm ground; ArduRover learns them (RCx_OPTION 50)"
    yield Finding("cruise-throttle", Level.WARN, says, remedy, "CRUISE_THROTTLE", known["CRUISE_THROTTLE"])


def guarded(seen: Survey) -> Iterator[Finding]:
    """Whether a guard on the autopilot would stop a rover whose companion has fallen silent."""
    guard = seen.vehicle.guard
    meant = guard is None and seen.parameters.get("SCR_USER1", 0.0) > 0.0
    if meant and seen.parameters.get("SCR_ENABLE") == 0.0:
        says = "SCR_USER1 is set for a guard, but the autopilot runs no scripts: it would not stop the rover."
        yield to_set("guard", Level.WARN, says, "SCR_ENABLE", 0.0, 1.0)
    elif meant:
        says = "SCR_USER1 is set for a guard, but none is heard: it would not stop the rover if the companion dies."
        remedy = "upload it with `rover-companion guard --install`, and restart the autopilot"
        yield Finding("guard", Level.WARN, says, remedy)
    elif guard is None:
        says = "No guard on the autopilot: what the companion told last goes on for 3 s if it dies."
        yield Finding("guard", Level.NOTE, says, "`rover-companion guard` gives a script that ends it after 0.3 s")
    elif guard.waits_s > IN_TIME_S + 1e-6:
        says = f"The guard on the autopilot waits {guard.waits_s:g} s"
        says += f": with more than {IN_TIME_S:g} s planned motions keep more room, as without one."
        yield Finding("late-guard", Level.NOTE, says, "set SCR_USER1 to 300, on a slow computer to 900 at most")
    elif 0.0 < (given_ms := seen.parameters.get("SCR_USER1", 0.0)) < GUARD_LEAST_MS:
        says = f"SCR_USER1 is {given_ms:g} ms, but the guard waits {GUARD_LEAST_MS:g} ms: it takes no less."
        yield to_set("guard-wait", Level.NOTE, says, "SCR_USER1", given_ms, 300.0)


def sticks(seen: Survey) -> Iterator[Finding]:
    """Whether the pilot's sticks are on the channels that the companion reads."""
    for name, wanted in STICKS.items():
        value = seen.parameters.get(name, wanted)
        if value != wanted:
            says = f"The pilot's sticks are read on channels 1 and 3, but {name} is {value:g}: they would not be seen."
            yield to_set("sticks", Level.WARN, says, name, value, wanted)


def stations(seen: Survey) -> Iterator[Finding]:
    """Whether the autopilot watches its ground station."""
    watching, station = seen.parameters.get("FS_GCS_ENABLE"), station_of(seen)
    if watching and station is not None and int(station[1]) not in seen.systems:
        says = (
            f"The autopilot watches ground station {station[1]:g}, which is not heard here: "
            "if it falls silent, the rover goes into HOLD."
        )
        yield Finding(
            "gcs-failsafe",
            Level.WARN,
            says,
            f"keep that ground station on, or set {station[0]} to its system id",
            *station,
        )
    elif watching == 0.0:
        says = "The autopilot does not watch the ground station: nobody notices when the people lose their link."
        yield to_set("gcs-failsafe", Level.NOTE, says, "FS_GCS_ENABLE", watching, 1.0)


def fence(seen: Survey) -> Iterator[Finding]:
    """The autopilot's fence."""
    if seen.fence_breached:
        says = "The rover is outside the autopilot's fence: it would not be let drive."
        remedy = "drive it inside in MANUAL, or change the fence"
        yield Finding("fence-breached", Level.STOP, says, remedy, "FENCE_ENABLE", seen.parameters.get("FENCE_ENABLE"))
    elif seen.parameters.get("FENCE_ENABLE"):
        says = "The autopilot's fence is on: targets beyond it are not reached."
        yield Finding(
            "fence",
            Level.NOTE,
            says,
            "look that all targets lie inside",
            "FENCE_ENABLE",
            seen.parameters["FENCE_ENABLE"],
        )


def station_of(seen: Survey) -> tuple[str, float] | None:
    """The parameter that names the autopilot's ground station, and its value."""
    return next(((name, seen.parameters[name]) for name in STATIONS if name in seen.parameters), None)


# All checks ------------------------------------------------------------------------------------------------------


CHECKS = (
    port,
    others,
    identity,
    firmware,
    mode_of,
    position,
    arming,
    rates,
    ranges,
    avoidance,
    guided,
    guarded,
    sticks,
    stations,
    fence,
)


def diagnose(seen: Survey, gps_fix: str = "any") -> list[Finding]:
    """All findings, the gravest first. ``gps_fix``: the setting ``safety.gps_fix``."""
    if not seen.rover_heard:
        return [*port(seen), *nobody(seen), *others(seen)]
    findings = [*(finding for check in CHECKS for finding in check(seen)), *gps(seen, gps_fix)]
    order = list(Level)
    return sorted(findings, key=lambda finding: order.index(finding.level))


def kernels(cold: bool) -> list[Finding]:
    """``cold``: kernels would have to be compiled before a run."""
    if not cold:
        return []
    remedy = "`rover-companion compile`: a minute, several on a Raspberry Pi"
    return [Finding("kernels-cold", Level.WARN, "The planner is not compiled yet on this computer.", remedy)]
