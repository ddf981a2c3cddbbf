"""The simulator: a rover with its autopilot in a world, advanced in steps; bytes in, time forward, bytes out.

Deterministic: the same world, start, seed and bytes at the same times give the same bytes.

Nouns: Simulator.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sitl.autopilot.autopilot import Autopilot
from sitl.autopilot.control.records import LOOP_HZ
from sitl.autopilot.control.tasks import compile_begins
from sitl.autopilot.lidar import LidarComponent
from sitl.autopilot.payload import CommandEvent
from sitl.autopilot.signing import SECURE_PORT, StoredKey
from sitl.autopilot.state import CommandLog, Storage
from sitl.autopilot.traffic import Traffic
from sitl.autopilot.vehicle import Vehicle
from sitl.faults.link_faults import LinkQueue
from sitl.faults.plan import FaultPlan, LinkFault
from sitl.faults.player import FaultPlayer
from sitl.plant.closed_loop import NOISE_COLUMNS, NoiseSettings, run_loops
from sitl.plant.outline import DISC, Outline, OutlinePose, mover_room_m, room_m
from sitl.plant.rover import SIM_ROVER, Drivetrain, new_rover, outline_of
from sitl.sensors.range_sensors import RangeSensing, SensorSuite, suite_named
from sitl.sensors.serial_lidar import MountedLidar, RoverPose, SerialLidar
from sitl.sim_link import SimLink
from sitl.world import geodesy
from sitl.world.truth import Collision, SimStart, Truth, collision_of
from sitl.world.world import World

NOISE_ROWS = 500
ROOM_REACH_M = 5.0
LIDAR_STREAM = 0x4C494441
"""Separates the random draws of lidars on serial lines from all others with the same seed."""
REHEARSAL_S = 4.0
"""After this time every range sensor has measured."""


class Simulator:
    """The whole simulated vehicle."""

    def __init__(
        self,
        world: World,
        start: SimStart,
        sensors: str | SensorSuite = "lidar-90",
        seed: int = 0,
        outline: Outline = DISC,
        parameters: Mapping[str, float] | None = None,
        noise: bool | NoiseSettings = True,
        lidar_rate_hz: float | None = None,
        turning_radius_m: float = 0.0,
        faults: FaultPlan | None = None,
        kept: Mapping[str, int] | None = None,
        drivetrain: Drivetrain = SIM_ROVER,
        lidars: Sequence[MountedLidar] = (),
    ) -> None:
        """``sensors``: a suite or its name; ``parameters``: ArduRover's, where they differ from the defaults.

        ``kept``: types of those parameters that have no effect here, but can be read and set. ``turning_radius_m``: 0
        for skid steering, else the plant has steered wheels; the autopilot learns that from its parameters
        (``autopilot.parameters.steered_wheels``), as on a real rover.

        ``lidars``: on serial lines of their own, which are not the autopilot's.

        Raises ValueError for an unknown suite, KeyError for an unknown parameter.
        """
        suite = suite_named(sensors) if isinstance(sensors, str) else sensors
        if lidar_rate_hz is not None and suite.lidar is not None:
            suite = replace(suite, lidar=replace(suite.lidar, rate_hz=lidar_rate_hz))
        settings = noise if isinstance(noise, NoiseSettings) else NoiseSettings() if noise else NoiseSettings.none()
        motion_seed, range_seed = np.random.SeedSequence(seed).spawn(2)
        self.world = world
        self._start = start
        self._parameters = dict(parameters or {})
        self._kept = dict(kept or {})
        self._storage = Storage()
        self._noise = settings.as_array()
        self._rng = np.random.default_rng(motion_seed)
        self._sensing = RangeSensing(suite, world, settings.range_m, np.random.default_rng(range_seed))
        streams = np.random.SeedSequence([LIDAR_STREAM, seed]).spawn(len(lidars))
        self.lidars = tuple(
            SerialLidar(mounted, world, settings.range_m, np.random.default_rng(stream))
            for mounted, stream in zip(lidars, streams, strict=True)
        )
        """On serial lines of their own, which are not the autopilot's."""
        self._rover = new_rover(start.north_m, start.east_m, start.heading_rad, outline, turning_radius_m, drivetrain)
        self._geo_start = (geodesy.to_units(start.home.lat_deg), geodesy.to_units(start.home.lon_deg))
        # Noise is drawn in blocks of fixed size, so that it does not depend on the batches of loops.
        self._draws = np.empty((NOISE_ROWS, NOISE_COLUMNS))
        self._row = NOISE_ROWS
        self._tick = 0
        self._links: list[SimLink] = []
        self._signing_key = StoredKey()
        self._collisions: list[Collision] = []
        self._command_log = CommandLog()
        self._surroundings, self._doors_move_s = world.surroundings(0.0), world.next_change_s(0.0)
        self._traffic = Traffic(world, self._geo_start, (start.north_m, start.east_m))
        self._player = FaultPlayer(faults or FaultPlan(), seed, self.lidars)
        self._has_faults = faults is not None and bool(faults.faults)
        self._off_until_s = 0.0
        self.boots = 0
        """How often the autopilot has booted."""
        self._boot()

    def _boot(self) -> None:
        self.boots += 1
        rover = self._rover[0]
        here = (float(rover["north_m"]), float(rover["east_m"]))
        origin = geodesy.moved(self._geo_start, here[0] - self._start.north_m, here[1] - self._start.east_m)
        self._vehicle = Vehicle(self._rover, origin, here, self._sensing, self._parameters, self._storage, self._kept)
        self._vehicle.control["tick"] = 0
        self._vehicle.estimate["heading_rad"] = rover["heading_rad"]
        self._vehicle.signing.restore(self._signing_key)
        self._command_log.booted_s = self.time_s
        self._vehicle.command_log = self._command_log
        self._autopilot = Autopilot(self._vehicle)
        lidar = self._sensing.suite.lidar
        self._lidar = LidarComponent(lidar, self._sensing, self._vehicle) if lidar else None
        self._player.rebooted(self._vehicle, self._rover, self._sensing)

    @property
    def time_s(self) -> float:
        """Simulated seconds since the simulator was created."""
        return self._tick / LOOP_HZ

    @property
    def truth(self) -> Truth:
        """The rover's true state."""
        rover = self._rover[0]
        return Truth(
            self.time_s,
            float(rover["north_m"]),
            float(rover["east_m"]),
            float(rover["heading_rad"]),
            float(rover["speed_m_s"]),
            float(rover["yaw_rate_rad_s"]),
            float(rover["slide_m_s"]),
        )

    @property
    def start(self) -> SimStart:
        """Where the rover was switched on."""
        return self._start

    @property
    def collisions(self) -> tuple[Collision, ...]:
        """All contacts with obstacles so far; a lasting one counts once."""
        return tuple(self._collisions)

    @property
    def commands(self) -> tuple[CommandEvent, ...]:
        """The commands for servos, relays and so on that the autopilot has answered, or has done in AUTO."""
        return tuple(self._command_log.events)

    @property
    def driven_m(self) -> float:
        """Metres driven, in either direction."""
        return float(self._rover[0]["driven_m"])

    @property
    def pilot_acts(self) -> bool:
        """Whether a fault has a pilot drive the rover."""
        return self._player.pilot_acts(self.time_s)

    def link_faults(self) -> list[LinkFault]:
        """Of the fault plan, those that are active."""
        return self._player.link_faults(self.time_s)

    @property
    def drawn_ah(self) -> float:
        """Ampere-hours drawn from the battery."""
        return float(self._rover[0]["drawn_ah"])

    @property
    def clearance_m(self) -> float:
        """Metres between the rover's outline and the nearest obstacle, moving or not; 0 to 5."""
        truth = self.truth
        return max(self.world_room_m(OutlinePose(truth.north_m, truth.east_m, truth.heading_rad)), 0.0)

    def world_room_m(self, pose: OutlinePose) -> float:
        """Metres that the rover's outline would have at a pose, negative where it would touch; at most 5."""
        outline = self.outline
        solid = self.world.layers(self.time_s).solid
        stands_m = float(room_m(solid, outline, pose, ROOM_REACH_M))
        return min(stands_m, float(mover_room_m(self.world.fleet, outline, pose, self.time_s)[0]))

    @property
    def vehicle(self) -> Vehicle:
        """The autopilot's state, for inspection."""
        return self._vehicle

    @property
    def outline(self) -> Outline:
        """The rover's."""
        return outline_of(self._rover.view(np.recarray)[0])

    @property
    def links(self) -> tuple[SimLink, ...]:
        """The links that are open."""
        return tuple(self._links)

    def rehearse(self) -> None:
        """Run four seconds and begin every kind of task, so that everything is compiled.

        Use a simulator that is discarded afterwards: its time has advanced and its noise is drawn.
        """
        self.connect()  # some sensors measure only for a client
        self.advance_to_s(REHEARSAL_S)
        compile_begins(self._vehicle.records)

    def connect(self, port: int = SECURE_PORT, name: str = "") -> SimLink:
        """A new link to the vehicle, through its serial port ``port`` (SERIALn); several may be open at once.

        It gets the lowest free number, from 1; ``name`` is for display.
        """
        taken = {one.number for one in self._links}
        number = next(n for n in range(1, len(taken) + 2) if n not in taken)
        link = SimLink(self._autopilot.open_channel(port), number, name)
        if self._player.touches_links:
            link.queues = (LinkQueue(link.number, "to_vehicle"), LinkQueue(link.number, "from_vehicle"))
        self._links.append(link)
        return link

    def disconnect(self, link: SimLink) -> None:
        """Close a link whose client has gone."""
        link.dropped = True
        if link in self._links:
            self._links.remove(link)
            self._autopilot.close_channel(link.channel)

    def advance_to_s(self, time_s: float) -> None:
        """Run the vehicle up to a time, in whole main loops of 20 ms; a time in the past has no effect."""
        goal = math.floor(time_s * LOOP_HZ + 1e-6)
        while self._tick < goal:
            if self._has_faults:
                self._apply_faults()
            self._receive()
            if self.world.doors:
                self._move_doors()
            self._run(min(goal - self._tick, self._loops_until_due()))
            self._send()

    @property
    def is_off(self) -> bool:
        """Whether the autopilot is without power."""
        return self._off_until_s > 0.0

    def _apply_faults(self) -> None:
        """Begin and end faults; handle loss and return of the autopilot's power."""
        if self.is_off and self.time_s >= self._off_until_s - 1e-6:
            self._off_until_s = 0.0
            self._reboot()
        if self.time_s >= self._player.due_s - 1e-6:
            self._player.step(self.time_s, self._vehicle, self._rover, self._sensing)
        if self._player.reboot_until_s is not None:
            self._off_until_s, self._player.reboot_until_s = self._player.reboot_until_s, None
            self._reboot()

    def _receive(self) -> None:
        for link in self._links:
            data = link.pass_in(self._player, self.time_s) if link.inbox or link.queues else b""
            if data and not self.is_off:
                self._autopilot.receive(link.channel, data)
                link.pass_out(self._player, self.time_s)
        if self._vehicle.rebooting:
            self._reboot()

    def _reboot(self) -> None:
        self._links_dropped()
        self._parameters = self._vehicle.parameters.as_dict()
        self._signing_key = self._vehicle.signing.stored
        self._boot()

    def _links_dropped(self) -> None:
        for link in self._links:
            link.dropped = True
        self._links.clear()

    def _move_doors(self) -> None:
        """A door moves with the first main loop that begins at its time or after it."""
        if self.time_s >= self._doors_move_s:
            self._surroundings = self.world.surroundings(self.time_s)
            self._doors_move_s = self.world.next_change_s(self.time_s)

    def _loops_until_due(self) -> int:
        if self.lidars:
            return 1  # they turn all the time
        due_us = self._autopilot.next_due_us()
        if self.world.doors:
            due_us = min(due_us, self._vehicle.time_us + 1e6 * (self._doors_move_s - self.time_s))
        if self._lidar is not None:
            due_us = min(due_us, self._lidar.next_due_us())
        if self._sensing.samples:
            due_us = min(due_us, self._vehicle.time_us + 1e6 * (self._sensing.next_due_s() - self.time_s))
        if self._traffic.talks:
            # Movers follow the simulator's clock, which a reboot of the autopilot does not reset.
            due_us = min(due_us, self._vehicle.time_us + 1e6 * (self._traffic.next_due_s() - self.time_s))
        if self._has_faults:
            due_us = min(due_us, self._vehicle.time_us + 1e6 * (self._fault_due_s() - self.time_s))
        return max(1, math.ceil((due_us - self._vehicle.time_us) * 1e-6 * LOOP_HZ - 1e-6))

    def _fault_due_s(self) -> float:
        """When a fault begins or ends, power returns, or a delayed packet arrives."""
        due_s = min(self._player.due_s, self._off_until_s) if self.is_off else self._player.due_s
        for link in self._links:
            if link.queues is not None:
                due_s = min(due_s, link.queues[0].next_due_s(), link.queues[1].next_due_s())
        return due_s

    def _run(self, loops: int) -> None:
        """Run main loops until they are done, or something happens that must be reported at once."""
        vehicle, contacts = self._vehicle, int(self._rover["contacts"][0])
        if self._row == NOISE_ROWS:
            self._draws = self._rng.standard_normal((NOISE_ROWS, NOISE_COLUMNS))
            self._row = 0
        done = run_loops(
            self._rover, vehicle.records, vehicle.origin_m, self._noise, self._draws[self._row : self._row + loops],
            self._surroundings, self.time_s,
        )  # fmt: skip
        self._row += done
        self._tick += done
        self._sensing.time_s = self.time_s
        for lidar in self.lidars:
            lidar.advance(self.time_s, RoverPose(*self._pose()))
        if int(self._rover["contacts"][0]) > contacts:
            self._collisions.append(collision_of(self._rover[0], self.world, self.time_s))

    def _pose(self) -> tuple[float, float, float]:
        """The true place and heading."""
        rover = self._rover
        return float(rover["north_m"][0]), float(rover["east_m"][0]), float(rover["heading_rad"][0])

    def _send(self) -> None:
        if not self.is_off:
            self._send_due()
        if self._player.touches_links:
            for link in self._links:
                link.pass_out(self._player, self.time_s)

    def _send_due(self) -> None:
        """Measure and send everything that is due now."""
        if self._sensing.samples:
            self._sensing.sample(*self._pose())
        self._autopilot.run_due()
        if self._traffic.talks:
            self._traffic.send_due(self.time_s, (link.channel for link in self._links))
        if self._lidar is None:
            return
        data = self._lidar.packets(self._vehicle.time_us, *self._pose())
        if data:
            for link in self._links:
                if link.channel.spoken:  # scans are only routed to where a client was heard
                    link.channel.outbox += data
