"""One ray of a simulated sensor."""

from __future__ import annotations

from sitl.world.world import World, ray_length


def ray_m(world: World, north_m: float, east_m: float, bearing_rad: float, max_m: float, time_s: float = 0.0) -> float:
    """Metres along a bearing to the first obstacle that stands still and reflects the ray, or ``max_m``."""
    return float(ray_length(world.layers(time_s).echoing, north_m, east_m, bearing_rad, max_m))
