"""Decides which OpenStreetMap ways are roads, and normalizes their tags by making all implied values explicit."""

import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Literal, NamedTuple, Self

from pydantic import Field, TypeAdapter

from simbev_ros.config.base import Model
from simbev_ros.foundation.tables import load_table
from simbev_ros.maps.osm.data import Tags

_COPIED_KEYS = (
    "turn:lanes",
    "turn:lanes:forward",
    "turn:lanes:backward",
    "lanes:forward",
    "lanes:backward",
    "junction",
)
SIDEWALK_M = 2.2
"""Width of sidewalks."""

_WIDTH_KEYS = {"width:lanes": "right", "width:lanes:forward": "right", "width:lanes:backward": "left"}
"""Key of lane widths → side of the way whose sidewalk runs beside these lanes."""
_MIN_LANE_M, _MAX_LANE_M = 2.0, 8.0
_SHARED_WIDTH = "2.5"  # m for each direction of a road that has one lane for both
_CYCLE_LANES = ("cycleway", "cycleway:left", "cycleway:right", "cycleway:both")
_MIRRORED_SIDES = {"left": "right", "right": "left"}
_MIRRORED_KEYS = {
    f"{key}:{side}": f"{key}:{other}" for key in ("sidewalk", "cycleway") for side, other in _MIRRORED_SIDES.items()
}
_MINOR_SERVICE = ("driveway", "parking_aisle", "drive-through", "emergency_access")
_MAX_LANES = 10
_KMH_PER_MPH = 1.609344
_WALK_KMH = 6.0


class RoadRule(Model):
    """Defaults for a class of roads."""

    priority: int = Field(ge=1, le=20, description="at junctions, the higher priority has right of way")
    lanes: int = Field(1, ge=1)
    one_way: bool = False
    speed_kmh: float = Field(10.0, gt=0)
    sidewalk: Literal["both", "none"] = "none"
    bicycles: bool = True
    walk: bool = False


class RoadTags(NamedTuple):
    """Normalized description of a way as a road.

    Attributes:
        tags: Every tag that netconvert reads, in forms that it understands.
        reverse: The road runs against the direction of its way.
        walk: For pedestrians only.
        layer: Where roads cross without meeting, the one of the higher layer passes above.
        bridge: On a bridge.
        tunnel: Through a tunnel that vehicles drive in.
    """

    tags: Tags
    reverse: bool = False
    walk: bool = False
    layer: int = 0
    bridge: bool = False
    tunnel: bool = False

    def at_grade(self) -> Self:
        """The same road without its layer, for use when heights already describe bridges; tunnels keep their tag."""
        tags = {**self.tags, "tunnel": "yes"} if self.tunnel else self.tags
        return self._replace(tags=tags, layer=0, bridge=False)


@lru_cache(maxsize=1)
def road_rules() -> Mapping[str, RoadRule]:
    """Road rules by value of OpenStreetMap's key ``highway``."""
    return TypeAdapter(dict[str, RoadRule]).validate_python(load_table("simbev_ros.maps.osm", "road_rules.yaml"))


def road_tags(tags: Tags, left_hand: bool = False) -> RoadTags | None:
    """Normalized road tags of a way, or None if it is not a road.

    netconvert builds left-hand roads as mirrored right-hand ones, so left and right are exchanged for them.
    """
    tags = _mirror(tags) if left_hand else tags
    kind = tags.get("highway", "")
    rule = road_rules().get(kind)
    if rule is None or tags.get("area") == "yes" or _is_excluded(tags, rule):
        return None
    layer, bridge = _layer(tags), _is_true(tags.get("bridge"))
    tunnel = _is_true(tags.get("tunnel")) or (layer < 0 and tags.get("tunnel") == "building_passage")
    if rule.walk:
        return RoadTags({"highway": kind}, walk=True, layer=layer, bridge=bridge)
    one_way = tags.get("oneway", "yes" if rule.one_way or tags.get("junction") == "roundabout" else "no")
    runs_one_way = one_way in ("yes", "true", "1", "-1", "reverse")
    road = {key: tags[key] for key in _COPIED_KEYS if key in tags}
    road |= {key: "lane" for key in _CYCLE_LANES if tags.get(key) in ("lane", "track", "exclusive")}
    road |= {
        "highway": kind,
        "oneway": "yes" if runs_one_way else "no",
        "lanes": str(_lanes(tags, rule, runs_one_way)),
        "maxspeed": f"{_speed_kmh(tags, rule):.0f}",
        "sidewalk": _sidewalk(tags, rule, runs_one_way),
    }
    road |= _lane_widths(tags, road)
    return RoadTags(road, one_way in ("-1", "reverse"), False, layer, bridge, tunnel)


def _lane_widths(tags: Tags, road: Tags) -> Tags:
    """Tags of lane widths in netconvert's form, with the sidewalk as a further lane; none where cycle lanes are."""
    if any(key in road for key in _CYCLE_LANES) or (road["oneway"] == "yes" and road["sidewalk"] in ("left", "both")):
        return {}
    if _is_shared(tags, road["oneway"] == "yes"):
        tags = {**tags, "width:lanes:forward": _SHARED_WIDTH, "width:lanes:backward": _SHARED_WIDTH}
    found = {}
    for key, side in _WIDTH_KEYS.items():
        widths = [_to_number(text) for text in tags.get(key, "").split("|")]
        if all(_MIN_LANE_M <= width_m <= _MAX_LANE_M for width_m in widths):
            walk = [SIDEWALK_M] if road["sidewalk"] in (side, "both") else []
            found[key] = "|".join(f"{width_m:.2f}" for width_m in (*widths, *walk))
    return found


def _to_number(text: str) -> float:
    return float(text) if re.fullmatch(r"\d{1,2}(\.\d{1,3})?", text.strip()) else 0.0


def _mirror(tags: Tags) -> Tags:
    """Exchange sidewalks and cycle lanes of the left and the right side."""
    mirrored = {_MIRRORED_KEYS.get(key, key): value for key, value in tags.items()}
    if (side := tags.get("sidewalk")) in _MIRRORED_SIDES:
        mirrored["sidewalk"] = _MIRRORED_SIDES[side]
    return mirrored


def _is_excluded(tags: Tags, rule: RoadRule) -> bool:
    if rule.walk:
        separate = tags.get("footway") in ("sidewalk", "crossing")  # roads have their own
        return separate or tags.get("foot", tags.get("access")) in ("no", "private")
    if tags.get("service") in _MINOR_SERVICE:
        return True
    return tags.get("motor_vehicle", tags.get("vehicle", tags.get("access"))) == "no"


def _layer(tags: Tags) -> int:
    """The layer tag, or the default of a bridge or tunnel without it."""
    text = tags.get("layer", "")
    if re.fullmatch(r"-?[1-5]", text):
        return int(text)
    return 1 if _is_true(tags.get("bridge")) else -1 if _is_true(tags.get("tunnel")) else 0


def _is_true(value: str | None) -> bool:
    return value not in (None, "no", "building_passage")


def _is_shared(tags: Tags, one_way: bool) -> bool:
    """Whether a road has one lane for both directions; netconvert would make lanes of 1.6 m, narrower than cars."""
    return tags.get("lanes") == "1" and not one_way


def _lanes(tags: Tags, rule: RoadRule, one_way: bool) -> int:
    text = "2" if _is_shared(tags, one_way) else tags.get("lanes", "")
    if text.isdecimal() and 1 <= int(text) <= _MAX_LANES:
        return int(text)
    return max(1, rule.lanes // 2) if one_way and not rule.one_way else rule.lanes


def _speed_kmh(tags: Tags, rule: RoadRule) -> float:
    return stated_speed_kmh(tags) or rule.speed_kmh


def stated_speed_kmh(tags: Tags) -> float:
    """Speed limit that a way states, at least 1 km/h; 0 if it states none, or none that is a number."""
    text = tags.get("maxspeed", "")
    match = re.fullmatch(r"(\d{1,3}(?:\.\d{1,3})?)(?: ?(mph|km/h|kmh|kph))?", text)
    if match is None or float(match[1]) == 0.0:
        return _WALK_KMH if text.endswith("walk") else 0.0
    return max(1.0, float(match[1]) * (_KMH_PER_MPH if match[2] == "mph" else 1.0))


def is_unread_speed(tags: Tags) -> bool:
    """Whether a way states a speed limit that is none here; such as ``none`` are limits of the kind of road."""
    text = tags.get("maxspeed", "")
    return text not in ("", "none", "signals", "variable") and ":" not in text and not stated_speed_kmh(tags)


def _sidewalk(tags: Tags, rule: RoadRule, one_way: bool) -> str:
    """``both``, ``left``, ``right`` or ``no``; a sidewalk mapped as "separate" counts as the road's own."""
    value = tags.get("sidewalk", tags.get("sidewalk:both"))
    if value in ("left", "right"):
        return value
    if value is not None:
        return "no" if value in ("no", "none") else "both"
    sides = {side: tags[f"sidewalk:{side}"] for side in ("left", "right") if f"sidewalk:{side}" in tags}
    if sides:
        present = [side for side, state in sides.items() if state not in ("no", "none")]
        return "both" if len(present) == 2 else present[0] if present else "no"
    if rule.sidewalk == "none":
        return "no"
    # A large one-way road is usually half of a divided road: its left side is the median.
    divided = one_way and (rule.priority >= 11 or tags.get("junction") == "roundabout")
    return "right" if divided else "both"
