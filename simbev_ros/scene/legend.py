"""Legend of a dataset: the meaning of the numbers in its tables and images, for readers without this package."""

from collections.abc import Sequence
from enum import IntEnum, IntFlag
from typing import Any

from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES, DIFFICULTIES, SIGN_TYPES, Tag
from simbev_ros.maps.network import Signal
from simbev_ros.scene.blueprints import Blueprint, load_blueprints
from simbev_ros.schema.scene.state import Behavior, Light, SignalState


def legend(signals: Sequence[Signal] = ()) -> dict[str, Any]:
    """Legend as plain JSON values: lists are indexed by the number they explain, bit flags are listed by value.

    Args:
        signals: The map's signals. There is one entry for each, in the row order of /world/signals: the signal program
            it follows, and the signal of /world/map it belongs to (null if the map does not name one).
    """
    return {
        "blueprints": [_blueprint(blueprint) for blueprint in load_blueprints()],
        "box_classes": list(BOX_CLASSES),
        "bev_classes": list(BEV_CLASSES),
        "difficulties": list(DIFFICULTIES),
        "sign_types": list(SIGN_TYPES),
        "tags": _values(Tag),
        "signal_states": _values(SignalState),
        "light_bits": _values(Light),
        "behavior_bits": _values(Behavior),
        "signals": [{"programme": each.programme, "opendrive_id": each.opendrive_id or None} for each in signals],
    }


def _blueprint(blueprint: Blueprint) -> dict[str, Any]:
    tag = blueprint.tag.name.lower()
    return {"name": blueprint.name, "tag": tag, "class": blueprint.box_class, "emergency": blueprint.emergency}


def _values(numbers: type[IntEnum | IntFlag]) -> dict[str, int]:
    return {member.name.lower(): int(member) for member in numbers if member.name}
