"""BATTERY_STATUS and SYS_STATUS: volts and per cent, and how each says that it does not know."""

from __future__ import annotations

from typing import Any

from companion.vehicle.events.plan import BatterySeen

NO_CELL_MV = 65535
OF_SYS_STATUS = -1


def battery_status(message: Any, time_s: float) -> BatterySeen:
    """BATTERY_STATUS: ArduPilot gives the whole voltage as the first cell where it knows no cells, and more than 65 V in pieces."""
    cells_mv = [cell for cell in message.voltages if cell != NO_CELL_MV] + list(message.voltages_ext)
    volts = sum(cells_mv) / 1000.0
    return _seen(time_s, message.id, volts, message.battery_remaining, message.charge_state)


def sys_status(message: Any, time_s: float) -> BatterySeen:
    """SYS_STATUS: the first battery in short."""
    volts = 0.0 if message.voltage_battery == NO_CELL_MV else message.voltage_battery / 1000.0
    return _seen(time_s, OF_SYS_STATUS, volts, message.battery_remaining, 0)


def _seen(time_s: float, number: int, volts: float, percent: int, charge_state: int) -> BatterySeen:
    """0 V is no reading; without one, 0 % is none either (it is what a vehicle without a battery monitor may say)."""
    known_v = volts if volts > 0.0 else None
    unknown = not 0 <= percent <= 100 or (percent == 0 and known_v is None)
    return BatterySeen(time_s, number, known_v, None if unknown else percent, charge_state)
