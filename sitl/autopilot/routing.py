"""Routing of packets between the vehicle's links (behaviour of MAVLink_routing).

Nouns: MAVLink_routing.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

AUTOPILOT = 1

MOST_ROUTES = 20


@dataclass(frozen=True, slots=True)
class Route:
    """A component, and a channel on which it was heard."""

    system: int
    component: int
    channel: int


class Router:
    """The routes learned so far; a component may be heard on several channels."""

    def __init__(self) -> None:
        """No routes yet."""
        self._routes: list[Route] = []

    def learn(self, system: int, component: int, channel: int) -> None:
        """Remember that a component was heard on a channel."""
        route = Route(system, component, channel)
        if route not in self._routes and system != 0 and len(self._routes) < MOST_ROUTES:
            self._routes.append(route)

    def forget(self, channel: int) -> None:
        """Forget the routes of a closed channel."""
        self._routes = [route for route in self._routes if route.channel != channel]

    def heartbeat_to(self, system: int, component: int, source: int, active: Iterable[int]) -> set[int]:
        """Channels to which a heartbeat is forwarded: all active ones except those on which its sender was heard."""
        heard = {route.channel for route in self._routes if (route.system, route.component) == (system, component)}
        return set(active) - heard - {source}

    def forward_to(self, system: int, target_system: int, target_component: int, source: int) -> set[int]:
        """Channels that get a copy of a packet from channel ``source``; target 0 is a broadcast, or no target at all.

        ``system`` is the autopilot's own. A packet for another system goes to every channel on which that system was
        heard.
        """
        if target_system == system and target_component == AUTOPILOT:
            return set()
        foreign = target_system not in (0, system)
        return {
            route.channel
            for route in self._routes
            if target_system == 0
            or (target_system == route.system and (foreign or target_component in (0, route.component)))
        } - {source}

    @staticmethod
    def is_for_autopilot(system: int, target_system: int, target_component: int, forwarded: bool) -> bool:
        """Whether the autopilot handles a packet: addressed to it, a broadcast, or one that could not be forwarded."""
        if target_system not in (0, system):
            return False
        return target_component in (0, AUTOPILOT) or not forwarded
