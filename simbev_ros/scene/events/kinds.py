"""The table of the kinds of events: which ability each one asks for, where it can be, and what is drawn for it."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Literal

from simbev_ros.config.base import Model
from simbev_ros.foundation.tables import load_table
from simbev_ros.schema.scene.drive_spec import EventKind
from simbev_ros.schema.scene.spec import Ignored

Ability = Literal["merging", "overtaking", "emergency_brake", "give_way", "traffic_sign"]
"""Abilities by which Bench2Drive groups its scenes."""


class EventClass(Model):
    """One kind of event; kinds.yaml explains the fields."""

    ability: Ability
    places: str
    notice_m: float
    vehicles: tuple[str, ...] = ()
    people: tuple[str, ...] = ()
    ignores: tuple[Ignored, ...] = ()
    drawn: Mapping[str, tuple[float, float]] = {}


@lru_cache(maxsize=1)
def event_classes() -> Mapping[EventKind, EventClass]:
    """All kinds of events."""
    rows = load_table("simbev_ros.scene.events", "kinds.yaml")
    return {EventKind(name): EventClass(**row) for name, row in rows.items()}
