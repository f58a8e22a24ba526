"""The interface through which production reports progress, to a terminal or to a Python program."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.production.scene_cost import SceneCost
from simbev_ros.scene.ending import SceneEnd
from simbev_ros.schema.scene.spec import SceneSpec


class ProductionObserver:
    """Receives the progress of playing scenes and making datasets.

    Every method does nothing, so an instance of this class is silent; a subclass overrides the methods of interest.
    They are called in the thread that called production and should return quickly. Each ``…_started`` is followed by
    its ``…_ended``, also after an error or Ctrl-C.

    Example:
        >>> class Printer(ProductionObserver):
        ...     def scene_made(self, entry: PlannedEntry, dataset_bytes: int) -> None:
        ...         print(f"{entry.name} is ready")
    """

    def step_started(self, step: str) -> None:
        """A step of unknown length begins, for example ``roads of Town03``. Steps do not nest."""

    def step_ended(self) -> None:
        """The step that was started last has ended."""

    def map_noted(self, map_name: str, note: str) -> None:
        """A map has a peculiarity, for example something that had to be repaired in its file."""

    def surroundings_started(self, map_name: str, regions: int) -> None:
        """The static scene of a map is about to be built in a number of regions."""

    def region_built(self) -> None:
        """One more region of the surroundings is in the cache."""

    def surroundings_ended(self) -> None:
        """The building of surroundings has ended."""

    def graph_started(self, domain_id: int, security_variables: Mapping[str, str]) -> None:
        """The node graph runs in a ROS domain; a secure one is open to processes with these environment variables."""

    def stack_evaluated(self, figures: Mapping[str, Any]) -> None:
        """The graph has ended, and these are the figures of a stack that ran with it (``live_figures``)."""

    def leftover_removed(self, spec: SceneSpec) -> None:
        """The unfinished bag that an earlier run left of a scene was removed; the scene is recorded again."""

    def scene_started(self, spec: SceneSpec) -> None:
        """A scene is sent to the graph, whose nodes begin to load it."""

    def scene_progressed(self, spec: SceneSpec, tick: int | None) -> None:
        """Called several times per second with the last tick that all nodes have finished; None while they load."""

    def scene_ended(self, spec: SceneSpec, end: SceneEnd | None) -> None:
        """A scene was played to its end; None: it failed or was interrupted."""

    def graph_warned(self, node: str, message: str) -> None:
        """A node of the graph has logged a warning, or the supervisor waits for a node outside and says why."""

    def dataset_started(self, scenes: int, dataset_bytes: int) -> None:
        """A number of scenes is about to be made; those that exist take this much space."""

    def workers_chosen(self, workers: int, cost: SceneCost) -> None:
        """The number of workers was chosen by what the first scene has cost."""

    def worker_prepares(self, worker: str, step: str | None) -> None:
        """One of several workers begins a step of unknown length, such as ``roads of Town03``; None: it has ended."""

    def scene_retried(self, entry: PlannedEntry, reason: str) -> None:
        """An attempt at a scene failed, or its worker was lost; it will be made again."""

    def scene_made(self, entry: PlannedEntry, dataset_bytes: int) -> None:
        """A scene is in the dataset, whose scenes now take this much space."""

    def scene_failed(self, entry: PlannedEntry, reason: str) -> None:
        """A scene could not be made; production continues with the next one."""

    def dataset_ended(self) -> None:
        """No further scene of the dataset is made."""


SILENT = ProductionObserver()
"""The default observer, which ignores everything."""


class SeveralObservers(ProductionObserver):
    """Passes every call on to several observers, in their order.

    Args:
        observers: They receive the calls.
    """

    def __init__(self, *observers: ProductionObserver) -> None:
        for event in [name for name in vars(ProductionObserver) if not name.startswith("_")]:
            setattr(self, event, _call_all([getattr(observer, event) for observer in observers]))


def _call_all(methods: Sequence[Callable[..., None]]) -> Callable[..., None]:
    def call(*arguments: Any) -> None:
        for method in methods:
            method(*arguments)

    return call


@contextmanager
def observe_step(observer: ProductionObserver, step: str) -> Iterator[None]:
    """Report a step of unknown length for as long as the context is open."""
    observer.step_started(step)
    try:
        yield
    finally:
        observer.step_ended()
