"""Whatever may come in."""

from __future__ import annotations

from companion.events.parameters import ParameterRequest
from companion.events.plan import BatterySeen, FenceStatusSeen, PlanChangedSeen, PlanCountSeen, PlanItemSeen
from companion.events.targets import ItemCurrentSeen, ItemReachedSeen, LegSeen, TargetAsked
from companion.events.vehicle import (
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
from companion.latency import TimeAnswered
from companion.sticks import SticksSeen

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
