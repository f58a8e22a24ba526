"""Playing scenes on a node graph, with or without recording: the core of ``simbev run``, ``demo`` and ``replay``."""

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import zip_longest
from pathlib import Path
from typing import Any

from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import DiskError, GraphError, SimbevError
from simbev_ros.foundation.files.whole_files import require_writable
from simbev_ros.production.drawing import draw_scenes
from simbev_ros.production.events import (
    GraphStarted,
    GraphWarned,
    SceneEnded,
    SceneProgressed,
    SceneStarted,
    StackEvaluated,
)
from simbev_ros.production.free_stations import require_free_stations
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.record_folder import hold_record_folder, keep_recorded
from simbev_ros.production.scene_log import Attempt, write_scene_log
from simbev_ros.production.surroundings import build_surroundings
from simbev_ros.recording.layout import scene_folder
from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments
from simbev_ros.ros.graph.exposure import LOCAL, Exposure
from simbev_ros.ros.graph.interrupts import Interrupted
from simbev_ros.ros.graph.monitor import SUPERVISOR
from simbev_ros.ros.graph.session import GraphSession
from simbev_ros.scene.ending import SceneEnd
from simbev_ros.schema.scene.spec import SceneSpec


def play_scenes(
    scenario: Scenario,
    *,
    live: bool = False,
    dataset: Path | None = None,
    domain: int | None = None,
    exposure: Exposure = LOCAL,
    ros: RosArguments = PLAIN,
    observer: ProductionObserver = SILENT,
) -> list[Path]:
    """Play every scene of a configuration and return the folders of the recorded bags.

    All input is checked before the graph starts.

    Args:
        scenario: The configuration.
        live: Paced by the wall clock instead of as fast as possible.
        dataset: Folder to record into; None: nothing is recorded.
        domain: ROS domain; None: that of the environment, else a free one.
        exposure: Who can take part in the graph.
        ros: ROS arguments of all nodes of the graph, and its namespace.
        observer: Receives the progress.

    Raises:
        InputError: A scene cannot be drawn, or its bag cannot be written.
        DiskError: The disk is full, or nearly.
        GraphError: A node died or fell silent.
    """
    if dataset is not None:
        require_writable(dataset)
    specs = draw_scenes(scenario, observer)
    options: dict[str, Any] = {"live": live, "dataset": dataset, "domain": domain, "exposure": exposure, "ros": ros}
    with keep_recorded(dataset):
        bags = list(play_specs(scenario, specs, **options, observer=observer))
    if dataset is None:
        return []
    if lost := [bag for bag in bags if not bag.is_dir()]:  # live, where the graph does not wait for the recorder
        raise GraphError(f"node recorder has not left a bag: {lost[0]}")
    return bags


def play_specs(
    scenario: Scenario,
    specs: Sequence[SceneSpec],
    *,
    live: bool = False,
    dataset: Path | None = None,
    domain: int | None = None,
    exposure: Exposure = LOCAL,
    ros: RosArguments = PLAIN,
    replays: Sequence[Path] = (),
    observer: ProductionObserver = SILENT,
) -> Generator[Path, None, None]:
    """Play drawn scenes one after the other on one graph; yield the folder of each scene's bag when the scene ends.

    The folder is yielded whether or not the scene was recorded. The graph runs until the generator is exhausted or
    closed.

    Args:
        scenario: The configuration.
        specs: The scenes.
        live: Paced by the wall clock instead of as fast as possible.
        dataset: Folder to record into; None: nothing is recorded.
        domain: ROS domain; None: that of the environment, else a free one.
        exposure: Who can take part in the graph.
        ros: ROS arguments of all nodes of the graph, and its namespace.
        replays: For each scene a bag to take all motion from; empty: motion is simulated.
        observer: Receives the progress.

    Raises:
        InputError: A scene's bag cannot be written.
        DiskError: The disk is full, or nearly.
        GraphError: A node died or fell silent.
    """
    with ExitStack() as held:
        if dataset is not None:
            held.enter_context(hold_record_folder(dataset, scenario, specs, live=live, observer=observer))
        build_surroundings(specs, observer)
        require_free_stations(scenario, specs)
        session = GraphSession(scenario, live=live, dataset=dataset, domain=domain, exposure=exposure, ros=ros)
        held.enter_context(_run_graph(session, observer))
        observer.notify(GraphStarted(session.domain, session.security_variables))
        for spec, replay in zip_longest(specs, replays):
            play_on(session, spec, observer, replay=replay, log_to=dataset)
            yield scene_folder(dataset or Path(), spec.split, spec.name)


def play_on(
    session: GraphSession,
    spec: SceneSpec,
    observer: ProductionObserver = SILENT,
    *,
    replay: Path | None = None,
    config: Scenario | None = None,
    on_tick: Callable[[int | None], None] = lambda tick: None,
    log_to: Path | None = None,
    paused: bool = False,
) -> SceneEnd:
    """Play one scene on a running graph and report its progress.

    Args:
        session: The graph.
        spec: The scene.
        observer: Receives the progress.
        replay: A bag to take all motion from; None: motion is simulated.
        config: The scene's configuration, if it is not that of the graph.
        on_tick: Called after the observer with the last finished tick, for callers that measure.
        log_to: The dataset that gets a log of the scene; None: none.
        paused: Whether the world waits before the first tick.

    Raises:
        InputError: A node cannot do what is asked for.
        DiskError: The disk is full, or nearly.
        GraphError: A node died or fell silent.
    """

    def progress(tick: int | None) -> None:
        observer.notify(SceneProgressed(spec.name, tick))
        for advice in (*session.new_losses(), *session.new_advice()):
            observer.notify(GraphWarned(SUPERVISOR, advice))
        on_tick(tick)

    end: SceneEnd | None = None
    attempt = Attempt(spec.name, 1, "")
    observer.notify(SceneStarted(spec))
    try:
        end = session.play(spec, progress, replay, config, paused=paused)
        if log_to is not None:
            write_scene_log(log_to, attempt, f"{end.reason} after tick {end.tick}", session.new_output())
    except Interrupted:
        if log_to is not None and spec.drive is not None and not spec.is_driven_by_traffic:  # nothing would repeat it
            session.end_interrupted()
        raise
    except SimbevError as error:
        if log_to is not None:
            with suppress(DiskError):  # a full disk may be the reason
                write_scene_log(log_to, attempt, str(error), session.new_output(), failed=True)
        raise
    finally:
        observer.notify(SceneEnded(spec.name, end))
        losses = ((SUPERVISOR, loss) for loss in session.new_losses())  # since the last progress
        for node, message in (*losses, *session.new_warnings()):
            observer.notify(GraphWarned(node, message))
    return end


@contextmanager
def _run_graph(session: GraphSession, observer: ProductionObserver) -> Iterator[None]:
    """Run a graph and report the figures of evaluated stacks at its end, also after Ctrl-C."""
    failed = False
    try:
        with session:
            yield
    except SimbevError:  # its message is what counts; the figures of the scenes so far are in the file
        failed = True
        raise
    finally:
        for figures in () if failed else session.figures:
            observer.notify(StackEvaluated(figures))
