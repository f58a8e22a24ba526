"""Evaluation while the graph runs: what a perception stack says is compared with the truth, frame by frame."""

import shlex
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, field_validator, model_validator

from simbev_ros.config.base import Model
from simbev_ros.semantics import BEV_CLASSES, BOX_CLASSES

BOXES_TOPIC, GRIDS_TOPIC = "/prediction/boxes", "/prediction/bev"
"""Where answers are expected."""
REFERENCE_STACK = "reference_stack"
"""Name of the reference stack on /sync/ready, and of its module."""
_REFERENCE = ("reference",)

_Topic = Annotated[str, Field(pattern=r"^(/[A-Za-z_]\w*)+$")]


def _words(value: object) -> object:
    """A command as it is typed in a shell, in words."""
    words = tuple(shlex.split(value)) if isinstance(value, str) else value
    if words in ((), []):
        raise ValueError("there is no command in it")
    return words


class Evaluation(Model):
    """Which answers are evaluated, and who gives them."""

    boxes_topic: _Topic = Field(BOXES_TOPIC, description="PointCloud2, MarkerArray or Detection3DArray")
    grids_topic: _Topic = Field(GRIDS_TOPIC, description="Image; OccupancyGrids have a topic a class below it")
    answers_to: _Topic | None = Field(
        None,
        description="input of the stack, from whose arrival latency counts, and at whose ticks frames are evaluated; "
        "none: the first lidar's points, else the first camera's camera_info, which comes with its images",
    )
    participant: str | None = Field(
        None, min_length=1, pattern="^[^:]+$", description="name of the stack on /sync/ready: the world waits for it"
    )
    stack: Annotated[tuple[str, ...] | None, BeforeValidator(_words)] = Field(
        None, description="command that runs the stack with the graph; `reference`: the one included"
    )
    range_m: float | None = Field(None, gt=0, description="boxes and cells count up to here; none: all do")
    least_points: int = Field(0, ge=0, description="of lidars and radars in a box that counts")
    least_visibility: float = Field(0.0, ge=0, le=1, description="of a box that counts")
    classes: tuple[str, ...] | None = Field(None, min_length=1, description="of boxes and cells; none: all")
    by: tuple[Literal["distance", "visibility", "points", "difficulty", "daytime", "weather"], ...] = Field(
        (), description="conditions by which there are tables, too"
    )
    figures: str | None = Field(
        None, min_length=1, description="file (.json) for the figures of all scenes, or folder for those of each"
    )

    @field_validator("classes")
    @classmethod
    def _classes_are_known(cls, names: tuple[str, ...] | None) -> tuple[str, ...] | None:
        known = dict.fromkeys((*BOX_CLASSES, *BEV_CLASSES))
        strange = [name for name in names or () if name not in known]
        if strange:
            raise ValueError(f"there is no {strange[0]!r}; allowed: {', '.join(known)}")
        return names

    @property
    def is_reference(self) -> bool:
        """Whether the reference stack is to run."""
        return self.stack == _REFERENCE

    @model_validator(mode="after")
    def _name_of_reference(self) -> Self:
        if self.is_reference and self.participant not in (None, REFERENCE_STACK):
            raise ValueError(f"participant: the reference stack is called {REFERENCE_STACK}; leave participant out")
        return self

    @property
    def participants(self) -> tuple[str, ...]:
        """Of the stack's nodes those that the world waits for."""
        if self.is_reference:
            return (REFERENCE_STACK,)
        return () if self.participant is None else (self.participant,)
