"""Events of production: everything that is reported to an observer, in this process and from workers to the driver.

Each ``…Started`` is followed by its ``…Ended``, also after an error or Ctrl-C. ``ProductionEvent`` is the union of all;
code that handles every event ends its match with ``assert_never``, so that mypy finds a forgotten one.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.production.scene_cost import SceneCost
from simbev_ros.scene.ending import SceneEnd
from simbev_ros.schema.scene.spec import SceneSpec


@dataclass(frozen=True, slots=True)
class StepStarted:
    """A step of unknown length begins, for example ``roads of Town03``. Steps do not nest."""

    step: str


@dataclass(frozen=True, slots=True)
class StepEnded:
    """The step that was started last has ended."""


@dataclass(frozen=True, slots=True)
class MapNoted:
    """A map has a peculiarity, for example something that had to be repaired in its file."""

    map_name: str
    note: str


@dataclass(frozen=True, slots=True)
class SurroundingsStarted:
    """The static scene of a map is about to be built in a number of regions."""

    map_name: str
    regions: int


@dataclass(frozen=True, slots=True)
class RegionBuilt:
    """One more region of the surroundings is in the cache."""


@dataclass(frozen=True, slots=True)
class SurroundingsEnded:
    """The building of surroundings has ended."""


@dataclass(frozen=True, slots=True)
class GraphStarted:
    """The node graph runs in a ROS domain; a secure one is open to processes with these environment variables."""

    domain_id: int
    security_variables: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class GraphWarned:
    """A node of the graph has logged a warning, or the supervisor waits for a node outside and says why."""

    node: str
    message: str


@dataclass(frozen=True, slots=True)
class StackEvaluated:
    """The graph has ended, and these are the figures of a stack that ran with it (``live_figures``)."""

    figures: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class LeftoverRemoved:
    """The unfinished bag that an earlier run left of a scene was removed; the scene is recorded again."""

    scene: str


@dataclass(frozen=True, slots=True)
class SceneRefused:
    """A drawn scene breaks rules of ``accept``, here in words; it is drawn again."""

    scene: str
    problems: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SceneStarted:
    """A scene is sent to the graph, and the nodes begin to load it."""

    spec: SceneSpec


@dataclass(frozen=True, slots=True)
class SceneProgressed:
    """The last tick of a scene that all nodes have finished, several times per second; None while they load."""

    scene: str
    tick: int | None


@dataclass(frozen=True, slots=True)
class SceneEnded:
    """A scene was played to its end; None: it failed or was interrupted."""

    scene: str
    end: SceneEnd | None


@dataclass(frozen=True, slots=True)
class DatasetStarted:
    """A number of scenes is about to be made; those that exist take this much space."""

    scenes: int
    dataset_bytes: int


@dataclass(frozen=True, slots=True)
class WorkersChosen:
    """The number of workers was chosen by the cost of the first scene."""

    workers: int
    cost: SceneCost


@dataclass(frozen=True, slots=True)
class WorkerPrepares:
    """One of several workers begins a step of unknown length, such as ``roads of Town03``; None: it has ended."""

    worker: str
    step: str | None


@dataclass(frozen=True, slots=True)
class SceneRetried:
    """An attempt at a scene failed, or its worker was lost; it will be made again."""

    entry: PlannedEntry
    reason: str


@dataclass(frozen=True, slots=True)
class SceneMade:
    """A scene is in the dataset, which now takes this much space."""

    entry: PlannedEntry
    dataset_bytes: int


@dataclass(frozen=True, slots=True)
class SceneFailed:
    """A scene could not be made; production continues with the next one."""

    entry: PlannedEntry
    reason: str


@dataclass(frozen=True, slots=True)
class DatasetEnded:
    """No further scene of the dataset is made."""


DatasetEvent = DatasetStarted | WorkersChosen | WorkerPrepares | SceneRetried | SceneMade | SceneFailed | DatasetEnded
"""Events of the driver of a dataset."""
ProductionEvent = (
    StepStarted
    | StepEnded
    | MapNoted
    | SurroundingsStarted
    | RegionBuilt
    | SurroundingsEnded
    | GraphStarted
    | GraphWarned
    | StackEvaluated
    | LeftoverRemoved
    | SceneRefused
    | SceneStarted
    | SceneProgressed
    | SceneEnded
    | DatasetEvent
)
"""Any event."""
