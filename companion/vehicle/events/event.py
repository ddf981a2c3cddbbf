"""Whatever may come in."""

from __future__ import annotations

from companion.vehicle.events.parameters import ParameterRequest
from companion.vehicle.events.plan import BatterySeen, FenceStatusSeen, PlanChangedSeen, PlanCountSeen, PlanItemSeen
from companion.vehicle.events.targets import ItemCurrentSeen, ItemReachedSeen, LegSeen, TargetAsked
from companion.vehicle.events.vehicle import (
    AckSeen,
    AttitudeSeen,
    EkfStatusSeen,
    GlobalPositionSeen,
    HeartbeatSeen,
    HomeSeen,
    LocalPositionSeen,
    OriginSeen,
    OtherSeen,
    ParameterSeen,
    PrearmSeen,
    RangeSeen,
    TargetSeen,
    TextSeen,
)
from companion.vehicle.link_latency import TimeAnswered
from companion.vehicle.rc_input import SticksSeen

Event = (
    HeartbeatSeen
    | LocalPositionSeen
    | AttitudeSeen
    | GlobalPositionSeen
    | OtherSeen
    | EkfStatusSeen
    | OriginSeen
    | HomeSeen
    | RangeSeen
    | AckSeen
    | TargetSeen
    | TextSeen
    | ParameterSeen
    | PrearmSeen
    | TimeAnswered
    | PlanCountSeen
    | PlanItemSeen
    | PlanChangedSeen
    | TargetAsked
    | SticksSeen
    | ParameterRequest
    | LegSeen
    | ItemReachedSeen
    | ItemCurrentSeen
    | FenceStatusSeen
    | BatterySeen
)
