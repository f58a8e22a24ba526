"""Section ``evaluation``: how answers of a perception stack are compared with the ground truth, live or from files."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, field_validator, model_validator

from simbev_ros.config.base import Model
from simbev_ros.config.included_stacks import INCLUDED_STACKS, TRACK_OPTION, IncludedStack
from simbev_ros.config.rig import Rig
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES, PAPER_CLASSES

BOXES_TOPIC, GRIDS_TOPIC = "/prediction/boxes", "/prediction/bev"
"""Default topics of the predicted boxes and grids of the first agent's stack."""

RINGS_M = (0.0, 20.0, 40.0, 60.0)
IOUS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
DISTANCES_M = (0.5, 1.0, 2.0, 4.0)
"""Thresholds of the paper for boxes."""

Truth = Literal["own", "joint"]
"""Ground truth against which an agent's stack is judged: the agent's own boxes, or those of all agents together."""

ParticipantName = Annotated[str, Field(pattern="^[^:]+$")]
"""Name of a node outside on /sync/ready, where a colon ends it."""
_Topic = Annotated[str, Field(pattern=r"^(/[A-Za-z_]\w*)+$")]


def answer_topics_of(agent: str) -> tuple[str, str]:
    """Default topics of the predicted boxes and grids of an agent other than the first one (empty: of the first)."""
    prefix = f"/{agent}" if agent else ""
    return prefix + BOXES_TOPIC, prefix + GRIDS_TOPIC


def split_command(value: object) -> object:
    """Split a command, as it is typed in a shell, into its arguments."""
    arguments = tuple(shlex.split(value)) if isinstance(value, str) else value
    if arguments in ((), []):
        raise ValueError("the command is empty")
    return arguments


class Evaluation(Model):
    """Evaluation of a perception stack while the graph runs: the stack, its topics and what is evaluated."""

    boxes_topic: _Topic = Field(
        BOXES_TOPIC, description="topic of predicted boxes: PointCloud2, MarkerArray or Detection3DArray"
    )
    grids_topic: _Topic = Field(
        GRIDS_TOPIC, description="topic of predicted grids: Image, or OccupancyGrid with a subtopic per class"
    )
    answers_to: _Topic | None = Field(
        None,
        description="input topic of the stack: latency is measured from its arrival, and the ticks with a message "
        "and labels are evaluated; none: the first lidar's points, else the first camera's camera_info, which comes "
        "with its images; for an included stack, the slowest sensor that it sees",
    )
    participant: ParticipantName | None = Field(
        None, description="name of the stack on /sync/ready; the world then waits for it"
    )
    stack: Annotated[tuple[str, ...] | None, BeforeValidator(split_command)] = Field(
        None,
        description="command that starts the stack with the graph, or the name of an included one: "
        f"{', '.join(f'`{name}`' for name in INCLUDED_STACKS)}; a baseline may be followed by a file (.onnx) of "
        f"weights that replaces the one in the package, and by `{TRACK_OPTION}`: its boxes then have ids of tracks",
    )
    truth: Truth = Field(
        "own",
        description="boxes that the stack must find; own: those of its agent; joint: with the points and the "
        "visibility that all agents of the scene together have, for stacks that use the data of several",
    )
    min_range_m: float = Field(0.0, ge=0, description="minimum distance of evaluated boxes and cells")
    range_m: float | None = Field(
        None, gt=0, description="maximum distance of evaluated boxes and cells; none: no limit"
    )
    min_points: int = Field(0, ge=0, description="minimum number of lidar and radar points in an evaluated box")
    min_visibility: float = Field(0.0, ge=0, le=1, description="minimum visibility of an evaluated box")
    seen: bool = Field(
        True, description="a box is evaluated only if a lidar or radar point is inside, or a camera sees a part of it"
    )
    classes: Literal["all"] | Annotated[tuple[str, ...], Field(min_length=1)] = Field(
        PAPER_CLASSES, description="classes of boxes and cells that are evaluated; all: also lights, signs, cones, …"
    )
    difficulties: tuple[Literal["easy", "medium", "hard"], ...] = Field(
        ("easy", "medium", "hard"), min_length=1, description="difficulties of evaluated boxes"
    )
    daytimes: tuple[Literal["day", "twilight", "night"], ...] = Field(
        ("day", "twilight", "night"),
        min_length=1,
        description="times of day of evaluated frames; it is twilight while the sun is within 6° of the horizon",
    )
    weathers: tuple[Literal["clear", "cloudy", "fog", "rain"], ...] = Field(
        ("clear", "cloudy", "fog", "rain"),
        min_length=1,
        description="weather of evaluated frames: rain from a precipitation of 10 %, else fog from a density of 20 %, "
        "else cloudy from 60 %",
    )
    by: tuple[Literal["distance", "visibility", "points", "difficulty", "daytime", "weather", "map"], ...] = Field(
        (),
        description="conditions by which results are broken down in additional tables; map: only of predictions in "
        "files",
    )
    rings_m: tuple[float, ...] = Field(
        RINGS_M, min_length=1, description="start of each ring of the table by distance, rising"
    )
    ious: tuple[Annotated[float, Field(gt=0, le=1)], ...] = Field(
        IOUS, description="thresholds for matching boxes by 3D IoU, rising"
    )
    distances_m: tuple[Annotated[float, Field(gt=0, le=1000)], ...] = Field(
        DISTANCES_M, description="thresholds for matching boxes by the distance of their centers, rising"
    )
    planar: bool = Field(False, description="distances and velocities without z")
    envelope: bool = Field(
        False, description="area under the envelope of precision over recall, as Pascal VOC, and not under its steps"
    )
    figures: str | None = Field(
        None,
        min_length=1,
        description="file (.json) for the figures of all scenes together, or folder for a file per scene",
    )

    @field_validator("classes")
    @classmethod
    def _classes_are_known(cls, names: Literal["all"] | tuple[str, ...]) -> Literal["all"] | tuple[str, ...]:
        known = dict.fromkeys((*BOX_CLASSES, *BEV_CLASSES))
        unknown = [name for name in (() if names == "all" else names) if name not in known]
        if unknown:
            raise ValueError(f"there is no {unknown[0]!r}; allowed: {', '.join(known)}")
        return names

    @field_validator("rings_m", "ious", "distances_m")
    @classmethod
    def _rise(cls, values: Sequence[float]) -> Sequence[float]:
        if any(low >= high for low, high in pairwise(values)) or min(values, default=0) < 0:
            raise ValueError(f"{', '.join(f'{each:g}' for each in values)}: must rise, the first from 0 or more")
        return values

    @model_validator(mode="after")
    def _something_counts(self) -> Self:
        if self.range_m is not None and self.range_m <= self.min_range_m:
            raise ValueError(f"range_m: {self.range_m:g} must be above min_range_m, {self.min_range_m:g}")
        if not (self.ious or self.distances_m):
            raise ValueError("ious, distances_m: at least one threshold is needed")
        return self

    @property
    def included(self) -> IncludedStack | None:
        """The stack, if it is one of those that come with the package."""
        return None if self.stack is None else INCLUDED_STACKS.get(self.stack[0])

    @property
    def weights(self) -> str | None:
        """The file of weights for the included stack; None: those in the package."""
        return next((word for word in self._words_of_included if word != TRACK_OPTION), None)

    @property
    def tracks(self) -> bool:
        """Whether the included stack is to track its boxes."""
        return TRACK_OPTION in self._words_of_included

    @property
    def _words_of_included(self) -> tuple[str, ...]:
        """What follows the name of the included stack."""
        return () if self.stack is None or self.included is None else self.stack[1:]

    def participants_of(self, agent: str) -> tuple[str, ...]:
        """Nodes of the stack for which the world waits, by their names on /sync/ready.

        Args:
            agent: Name of an agent other than the first one; empty: it is the first one's stack.
        """
        if self.included is not None:
            return (self.included.participant_of(agent),)
        return () if self.participant is None else (self.participant,)

    @model_validator(mode="after")
    def _included_stack_is_given_right(self) -> Self:
        included = self.included
        if included is None or self.stack is None:
            return self
        words = sorted(self._words_of_included, key=TRACK_OPTION.__eq__)
        files = words[:-1] if self.tracks else words
        allowed = f"one file of weights and {TRACK_OPTION}" if included.is_model else "nothing"
        if len(files) > 1 or TRACK_OPTION in files or (words and not included.is_model):
            raise ValueError(f"stack: after {included.name} may come {allowed}, not {shlex.join(self.stack[1:])}")
        if self.participant not in (None, included.participant):
            raise ValueError(
                f"participant: the stack {included.name} is called {included.participant}; leave participant out"
            )
        return self


@dataclass(frozen=True)
class EvaluatedAgent:
    """An agent whose stack is evaluated while the graph runs.

    Attributes:
        name: Name of the agent; empty: the first one; its topics, stack and evaluator lack its name.
        rig: Its sensors.
        evaluation: Its section ``evaluation``.
    """

    name: str
    rig: Rig
    evaluation: Evaluation

    @property
    def participants(self) -> tuple[str, ...]:
        """Nodes of the stack for which the world waits, by their names on /sync/ready."""
        return self.evaluation.participants_of(self.name)

    def label(self, word: str) -> str:
        """Name of something in the graph that the agent has, such as ``evaluator_car_2``."""
        return f"{word}_{self.name}" if self.name else word
