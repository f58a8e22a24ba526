"""Which ways are roads, and their tags with all that is left to custom spelled out."""

import re
from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files
from typing import Literal, NamedTuple, Self

import yaml
from pydantic import Field, TypeAdapter

from simbev_ros.config.base import Model
from simbev_ros.maps.osm.data import Tags

_KEPT = ("turn:lanes", "turn:lanes:forward", "turn:lanes:backward", "lanes:forward", "lanes:backward", "junction")
_CYCLE_LANES = ("cycleway", "cycleway:left", "cycleway:right", "cycleway:both")
_MIRRORED_SIDES = {"left": "right", "right": "left"}
_MIRRORED_KEYS = {
    f"{key}:{side}": f"{key}:{other}" for key in ("sidewalk", "cycleway") for side, other in _MIRRORED_SIDES.items()
}
_MINOR_SERVICE = ("driveway", "parking_aisle", "drive-through", "emergency_access")
_MOST_LANES = 10
_KMH_PER_MPH = 1.609344


class RoadRule(Model):
    """What is assumed of a class of roads."""

    priority: int = Field(ge=1, le=20, description="at junctions the higher one has right of way")
    lanes: int = Field(1, ge=1)
    one_way: bool = False
    speed_kmh: float = Field(10.0, gt=0)
    sidewalk: Literal["both", "none"] = "none"
    bicycles: bool = True
    walk: bool = False


class RoadTags(NamedTuple):
    """What a way is as a road.

    Attributes:
        tags: For netconvert: every one that it reads, in forms that it knows.
        reverse: The road runs against its way.
        walk: For people alone.
        layer: Of roads that cross without meeting the higher one passes above.
        bridge: On a bridge.
        tunnel: Below ground.
    """

    tags: Tags
    reverse: bool = False
    walk: bool = False
    layer: int = 0
    bridge: bool = False
    tunnel: bool = False

    def at_grade(self) -> Self:
        """The same on the ground, where heights say all about bridges."""
        return self._replace(layer=0, bridge=False, tunnel=False)


@lru_cache(maxsize=1)
def road_rules() -> Mapping[str, RoadRule]:
    """By value of OpenStreetMap's key ``highway``."""
    text = files("simbev_ros.maps.osm").joinpath("road_rules.yaml").read_text(encoding="utf-8")
    return TypeAdapter(dict[str, RoadRule]).validate_python(yaml.safe_load(text))


def road_tags(tags: Tags, left_hand: bool = False) -> RoadTags | None:
    """The road that a way is, or None.

    netconvert builds left-hand roads as right-hand ones seen in a mirror: for these left and right change places.
    """
    tags = _mirrored(tags) if left_hand else tags
    kind = tags.get("highway", "")
    rule = road_rules().get(kind)
    if rule is None or tags.get("area") == "yes" or _closed_to_all(tags, rule):
        return None
    layer, bridge, tunnel = _layer(tags), _yes(tags.get("bridge")), _yes(tags.get("tunnel"))
    if rule.walk:
        return RoadTags({"highway": kind}, walk=True, layer=layer, bridge=bridge, tunnel=tunnel)
    one_way = tags.get("oneway", "yes" if rule.one_way or tags.get("junction") == "roundabout" else "no")
    runs_one_way = one_way in ("yes", "true", "1", "-1", "reverse")
    road = {key: tags[key] for key in _KEPT if key in tags}
    road |= {key: "lane" for key in _CYCLE_LANES if tags.get(key) in ("lane", "track", "exclusive")}
    road |= {
        "highway": kind,
        "oneway": "yes" if runs_one_way else "no",
        "lanes": str(_lanes(tags, rule, runs_one_way)),
        "maxspeed": f"{_speed_kmh(tags, rule):.0f}",
        "sidewalk": _sidewalk(tags, rule, runs_one_way),
    }
    return RoadTags(road, one_way in ("-1", "reverse"), False, layer, bridge, tunnel)


def _mirrored(tags: Tags) -> Tags:
    """Sidewalks and cycle lanes on the left of the way on its right, and the other way round."""
    mirrored = {_MIRRORED_KEYS.get(key, key): value for key, value in tags.items()}
    if (side := tags.get("sidewalk")) in _MIRRORED_SIDES:
        mirrored["sidewalk"] = _MIRRORED_SIDES[side]
    return mirrored


def _closed_to_all(tags: Tags, rule: RoadRule) -> bool:
    if rule.walk:
        separate = tags.get("footway") in ("sidewalk", "crossing")  # roads bring their own
        return separate or tags.get("foot", tags.get("access")) in ("no", "private")
    if tags.get("service") in _MINOR_SERVICE:
        return True
    return tags.get("motor_vehicle", tags.get("vehicle", tags.get("access"))) == "no"


def _layer(tags: Tags) -> int:
    """The tag, or what a bridge or tunnel without it means."""
    text = tags.get("layer", "")
    if re.fullmatch(r"-?[1-5]", text):
        return int(text)
    return 1 if _yes(tags.get("bridge")) else -1 if _yes(tags.get("tunnel")) else 0


def _yes(value: str | None) -> bool:
    return value not in (None, "no", "building_passage")


def _lanes(tags: Tags, rule: RoadRule, one_way: bool) -> int:
    text = tags.get("lanes", "")
    if text.isdecimal() and 1 <= int(text) <= _MOST_LANES:
        return int(text)
    return max(1, rule.lanes // 2) if one_way and not rule.one_way else rule.lanes


def _speed_kmh(tags: Tags, rule: RoadRule) -> float:
    match = re.fullmatch(r"(\d{1,3})(?: ?(mph|km/h))?", tags.get("maxspeed", ""))
    if match is None or int(match[1]) == 0:
        return rule.speed_kmh
    return int(match[1]) * (_KMH_PER_MPH if match[2] == "mph" else 1.0)


def _sidewalk(tags: Tags, rule: RoadRule, one_way: bool) -> str:
    """``both``, ``left``, ``right`` or ``no``; one beside the road ("separate") counts as the road's own."""
    value = tags.get("sidewalk", tags.get("sidewalk:both"))
    if value in ("left", "right"):
        return value
    if value is not None:
        return "no" if value in ("no", "none") else "both"
    sides = {side: tags[f"sidewalk:{side}"] for side in ("left", "right") if f"sidewalk:{side}" in tags}
    if sides:
        there = [side for side, state in sides.items() if state not in ("no", "none")]
        return "both" if len(there) == 2 else there[0] if there else "no"
    if rule.sidewalk == "none":
        return "no"
    # A large one-way road is mostly half of a divided one: its left side is the middle.
    divided = one_way and (rule.priority >= 11 or tags.get("junction") == "roundabout")
    return "right" if divided else "both"
