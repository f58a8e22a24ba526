"""Section ``accept``: rules for the motion in a scene; scenes that break one are drawn again before they are played."""

from typing import Self

from pydantic import Field, model_validator

from simbev_ros.config.base import Model


class Acceptance(Model):
    """Rules for the ego's motion and surroundings. A scene that breaks one is drawn again with its next seed.

    They are checked in a simulation of the traffic alone, which takes a small part of the time of a scene.
    """

    min_path_m: float = Field(0.0, ge=0, le=100_000, description="minimum length of the ego's path")
    min_mean_speed_mps: float = Field(0.0, ge=0, le=100, description="minimum mean speed of the ego")
    max_standing_share: float = Field(
        1.0, ge=0, le=1, description="maximum share of the recorded time in which the ego stands still"
    )
    min_boxes: float = Field(
        0.0,
        ge=0,
        le=10_000,
        description="minimum mean number of vehicles and people within the ego's `annotation.box_radius_m`",
    )
    no_collision: bool = Field(False, description="whether scenes in which the ego collides are drawn again")
    max_draws: int = Field(
        20, ge=1, le=1000, description="number of draws after which a scene fails; the message says what was wrong"
    )

    @model_validator(mode="after")
    def _has_rule(self) -> Self:
        rules = [name for name in type(self).model_fields if name != "max_draws"]
        if all(getattr(self, name) == type(self).model_fields[name].default for name in rules):
            raise ValueError(f"no rule is given; rules are {', '.join(rules)}")
        return self
