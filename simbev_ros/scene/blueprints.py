"""The actor blueprints: every kind of actor that can appear in a scene.

They are read from blueprints.yaml, two_wheelers.yaml, people.yaml and trailers.yaml, in this order.

The package ``assets`` builds their meshes.
"""

import math
from collections.abc import Iterable
from functools import lru_cache
from itertools import cycle, islice
from typing import Any, Literal, NamedTuple

from pydantic import field_validator

from simbev_ros.config.base import Model
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.tables import load_table

Clothing = Literal["cold", "mild", "warm", "rain"]
"""What people dress for."""


class VehicleFootprint(NamedTuple):
    """Geometry of a vehicle that follows a path; longitudinal distances are from its center.

    Attributes:
        length_m: Length of its box.
        width_m: Width of its box.
        lead_m: Distance from the center forward to the point that stays on the path.
        axle_m: Distance from the center back to the axle that is towed behind this point.
    """

    length_m: float
    width_m: float
    lead_m: float
    axle_m: float


class Blueprint(Model):
    """One kind of actor; blueprints.yaml explains the fields. A color that is listed twice is twice as frequent."""

    name: str
    kind: Literal["vehicle", "trailer", "rider", "pedestrian", "prop"]
    tag: Tag
    box_class: str
    size_m: tuple[float, float, float]
    colors: tuple[int, ...]
    colors2: tuple[int, ...] = ()
    old: bool = False
    wear: tuple[Clothing, ...] = ()
    walks_as_m: float = 0.0
    frequency: float = 0.0
    sumo_class: str = ""
    emergency: bool = False
    rider: str = ""
    accel: float = 0.0
    decel: float = 0.0
    max_speed_mps: float = 0.0
    wheelbase_m: float = 0.0
    wheel_radius_m: float = 0.0
    rider_seat_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    stride_m: float = 0.0
    doors: int = 0
    wheelchair: bool = False
    sits: bool = False
    runs_as: str = ""
    fast: str = ""
    land: str = ""
    tows: str = ""
    hitch_m: float = 0.0
    axle_m: float = 0.0

    @property
    def on_foot(self) -> bool:
        """Whether this is a pedestrian who walks or runs, neither sits nor uses a wheelchair."""
        return self.kind == "pedestrian" and not self.wheelchair and not self.sits

    @property
    def tall_m(self) -> float:
        """Height of a person, without a raised umbrella; strides depend on it."""
        return self.walks_as_m or self.size_m[2]

    def suits(self, weather: Iterable[Clothing]) -> bool:
        """Whether people go out like this in a weather."""
        return not self.wear or not {*self.wear}.isdisjoint(weather)

    @property
    def footprint(self) -> VehicleFootprint:
        """Footprint of a vehicle or trailer; a vehicle's axles lie half a wheelbase in front of and behind its center.

        The leading point is where the front bumper swings out of a bend by as much as the rear axle cuts it.
        """
        length_m, width_m, _ = self.size_m
        if self.kind == "trailer":
            return VehicleFootprint(length_m, width_m, self.hitch_m, self.axle_m)
        axle_m = self.wheelbase_m / 2.0
        return VehicleFootprint(length_m, width_m, (length_m / 2.0 + axle_m) / math.sqrt(2.0) - axle_m, axle_m)

    @property
    def train_length_m(self) -> float:
        """Length of a vehicle with what it tows, straight behind it."""
        if not self.tows:
            return self.size_m[0]
        towed = blueprint_named(self.tows)
        return self.size_m[0] / 2.0 - self.hitch_m + towed.hitch_m + towed.size_m[0] / 2.0

    @property
    def turning_footprint(self) -> VehicleFootprint:
        """Footprint of the rigid vehicle that cuts bends as far as this one with what it tows.

        On a steady circle, the squares of the distances from axle to axle add up, and that of a hitch's overhang counts
        negative (WHI formula of off-tracking: Western Highway Institute, Offtracking Characteristics of Trucks, 1970).
        """
        own = self.footprint
        if not self.tows:
            return own
        towed = blueprint_named(self.tows)
        overhang_m, length_m = -self.hitch_m - own.axle_m, towed.hitch_m + towed.axle_m
        trail_m = math.sqrt((own.lead_m + own.axle_m) ** 2 - overhang_m**2 + length_m**2)
        tail_m = towed.size_m[0] / 2.0 - towed.axle_m
        half_m = (own.length_m / 2.0 - own.lead_m + trail_m + tail_m) / 2.0
        return VehicleFootprint(
            2.0 * half_m, max(own.width_m, towed.size_m[1]), trail_m + tail_m - half_m, half_m - tail_m
        )

    @field_validator("tag", mode="before")
    @classmethod
    def _tag_by_name(cls, value: Any) -> Any:
        return Tag[value] if isinstance(value, str) else value


@lru_cache(maxsize=1)
def load_blueprints() -> tuple[Blueprint, ...]:
    """Load all blueprints; the index in the tuple is the ``blueprint`` column of the actors table."""
    data = load_table("simbev_ros.scene", "blueprints.yaml")
    palettes = data["palettes"] | _load_paints()
    entries: dict[str, dict[str, Any]] = {}
    towing = load_table("simbev_ros.scene", "trailers.yaml")["blueprints"]
    for row in [*data["blueprints"], *towing]:
        entries[row["name"]] = entries.get(row.pop("like", ""), {}) | row
    blueprints, rows, first = [], list(entries.values()), len(data["blueprints"])
    two_wheelers = load_table("simbev_ros.scene", "two_wheelers.yaml")["blueprints"]
    for entry in [*rows[:first], *two_wheelers, *_people(), *rows[first:]]:
        for field, name in (("colors", "palette"), ("colors2", "palette2")):
            palette = entry.pop(name, [])
            entry[field] = palette if isinstance(palette, list) else palettes[palette]
        blueprints.append(Blueprint(**entry))
    return tuple(blueprints)


def _load_paints() -> dict[str, list[int]]:
    """Palettes of paints.yaml: lists in which every paint is repeated as often as it is seen."""
    data = load_table("simbev_ros.scene", "paints.yaml")
    return {
        name: [paint for hue, count in shares.items() for paint in islice(cycle(data["hues"][hue]), count)]
        for name, shares in data["palettes"].items()
    }


def _people() -> list[dict[str, Any]]:
    """Entries of people.yaml, completed with what all people, their body and their outfit have in common."""
    data = load_table("simbev_ros.scene", "people.yaml")
    people = []
    for entry in data["people"]:
        body, outfit, *_ = entry["name"].split(".")[1:]
        people.append(data["all"] | data["bodies"][body] | data["outfits"].get(outfit, {}) | entry)
    return people


@lru_cache(maxsize=1)
def blueprint_index() -> dict[str, int]:
    """Index of each blueprint by name."""
    return {blueprint.name: index for index, blueprint in enumerate(load_blueprints())}


def blueprint_named(name: str) -> Blueprint:
    """The blueprint with this name."""
    return load_blueprints()[blueprint_index()[name]]
