"""Playing scenes that ROS nodes ask for: the core of ``simbev run --serve``."""

import importlib
import math
import time
from collections.abc import Generator
from contextlib import ExitStack
from itertools import chain
from pathlib import Path
from typing import Any

from simbev_ros.config.camera import Camera
from simbev_ros.config.evaluation import Evaluation
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.load import CONFIG_SUFFIXES, find_config, load_scenario, parse_scenario
from simbev_ros.config.radar import Radar
from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.plan import Plan
from simbev_ros.foundation.errors import GraphError, InputError, SimbevError
from simbev_ros.foundation.files.input_file import path_exists
from simbev_ros.foundation.files.limits import MAX_ORDERED_SAMPLES, MAX_ORDERED_SENSORS, MAX_SCENE_NUMBER
from simbev_ros.foundation.files.whole_files import require_writable
from simbev_ros.foundation.installation.message_packages.definitions import SERVED_MESSAGES
from simbev_ros.foundation.installation.message_packages.installer import install_missing
from simbev_ros.foundation.latest_value import LatestValue
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.production.drawing import draw_accepted
from simbev_ros.production.events import GraphStarted, GraphWarned
from simbev_ros.production.free_stations import require_free_stations
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.production.play import play_on
from simbev_ros.production.record_folder import hold_record_folder
from simbev_ros.production.surroundings import build_surroundings, load_roads
from simbev_ros.recording.layout import scene_folder
from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments
from simbev_ros.ros.graph.exposure import LOCAL, Exposure
from simbev_ros.ros.graph.scene_queue import OrderedScene, Outcome, Phase, SceneOrder, SceneQueue
from simbev_ros.ros.graph.scene_services import require_interfaces, scene_services
from simbev_ros.ros.graph.session import GraphSession
from simbev_ros.scene.drawing.draw_scene import PlannedScene, planned_scenes, start_positions
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec

_IDLE_S = 0.1
_ORDER_NAME = "configuration"
"""Name in messages of a configuration that comes as text."""


class OrderDrawer:
    """Draws the scenes of orders, which may come from anybody in the domain.

    Args:
        scenario: The configuration of the graph, for orders without one.
        dataset: Folder into which scenes are recorded; None: they are not. Each scene then gets a number of its own.
        observer: Receives what is wrong with files that an order names; clients, who may be strangers, do not.
    """

    def __init__(self, scenario: Scenario, dataset: Path | None, observer: ProductionObserver = SILENT) -> None:
        self._scenario, self._dataset, self._observer = scenario, dataset, observer
        self._used = set[int]() if dataset is None else {entry.number for entry in Plan.load(dataset).scenes}
        self._next_number = max(self._used, default=-1) + 1
        self._starts = LatestValue[tuple[MapSpec, float], StartPositions]()

    def draw(self, order: SceneOrder) -> tuple[Scenario, SceneSpec]:
        """Draw the scene of an order; return its configuration and its specification.

        Raises:
            InputError: The configuration is wrong or evaluates another stack, the scene cannot be drawn, or its number
                is that of a recorded one.
        """
        scenario = self._scenario_of(order)
        is_first = order.number is None and order.seed is not None
        number = self._next_number if order.number is None else order.number
        if is_first and self._dataset is None:
            number = 0
        if not 0 <= number <= MAX_SCENE_NUMBER:
            raise InputError(f"number {number}: must be 0 to {MAX_SCENE_NUMBER}")
        if self._dataset is not None and number in self._used:
            raise InputError(f"number {number}: {self._dataset} has a scene with it; ask for another one or for none")
        configured = list(planned_scenes(scenario))
        planned = configured[0 if is_first else number % len(configured)]._replace(
            number=number, seed=order.seed if is_first else None
        )
        network = load_roads(planned.map)
        spec = draw_accepted(scenario, planned, network, self._start_positions(scenario, network, planned))
        self._used.add(number)
        self._next_number = number + 1 if self._dataset is None else max(self._used) + 1
        return scenario, spec

    def _start_positions(self, scenario: Scenario, network: RoadNetwork, planned: PlannedScene) -> StartPositions:
        """Start positions of a map, kept for further scenes there."""
        key = planned.map, scenario.traffic.waypoint_spacing_m
        return self._starts.get(key, lambda: start_positions(scenario, network))

    def _read_configuration(self, words: str) -> Scenario:
        """The configuration in a file, of a name, or in YAML text."""
        is_text = "\n" in words or ": " in words
        if not is_text and Path(words).suffix not in CONFIG_SUFFIXES and path_exists(Path(words)):
            raise InputError(f"{words}: the name of a configuration file ends in {' or '.join(CONFIG_SUFFIXES)}")
        file = None if is_text else find_config(words)
        try:
            return parse_scenario(words, _ORDER_NAME) if file is None else load_scenario(file)
        except InputError as error:
            if str(error).startswith(f"{_ORDER_NAME}:"):
                raise
            self._observer.notify(GraphWarned("scenes", f"an order was refused: {error}"))
            raise InputError(f"{_ORDER_NAME}: a file that it names cannot be used; the graph's log says why") from None

    def _scenario_of(self, order: SceneOrder) -> Scenario:
        scenario = self._scenario
        if order.configuration:
            scenario = self._read_configuration(order.configuration)
            _require_moderate(scenario, self._scenario)
        if _stacks(scenario) != _stacks(self._scenario):
            raise InputError("evaluation: must be that of the configuration with which the graph was started")
        if order.seed is None:
            return scenario
        if order.seed < 0:
            raise InputError(f"seed {order.seed}: must be 0 or more")
        return scenario.model_copy(update={"seed": order.seed})


def _stacks(scenario: Scenario) -> dict[str, Evaluation]:
    """The evaluated stacks, by the name of their agent (empty: the first one)."""
    return {agent.name: agent.evaluation for agent in scenario.evaluated_agents}


def _require_moderate(scenario: Scenario, own: Scenario) -> None:
    """Check that an ordered rig does not need the whole machine; one as large as the graph's own is allowed.

    Raises:
        InputError: There are too many sensors, or they and the labels have too many pixels, rays, cells and voxels.
    """
    for count, most, words in (
        (_sensor_count, MAX_ORDERED_SENSORS, "sensors"),
        (_samples_per_tick, MAX_ORDERED_SAMPLES, "pixels, rays, cells and voxels"),
    ):
        if (found := count(scenario)) > (allowed := max(count(own), most)):
            raise InputError(f"rig: has {found:,} {words}; an order may have {allowed:,}")


def _sensor_count(scenario: Scenario) -> int:
    return sum(len(rig.sensors) for rig in scenario.rigs)


def _samples_per_tick(scenario: Scenario) -> int:
    """Pixels of all images, rays of all lidars and radars, cells and voxels, at a tick at which all are due."""
    sensors = [sensor for rig in scenario.rigs for sensor in rig.sensors]
    images = (s.width_px * s.height_px * len(s.modalities) for s in sensors if isinstance(s, Camera))
    rays = (s.channels * s.columns for s in sensors if isinstance(s, Lidar))
    radars = (scan for s in sensors if isinstance(s, Radar) for scan in s.scans_of_cycle)
    scans = (round(s.points_per_second * (1.0 / s.rate_hz if s.rate_hz else scenario.time.tick_s)) for s in radars)
    own, agents = scenario.annotation, scenario.agents
    labels = [(own, 1), *((agent.annotation or own, agent.max_count) for agent in agents)]
    cells = (number * each.bev.rows * each.bev.columns for each, number in labels)
    voxels = (number * math.prod(each.occupancy.grid.shape) for each, number in labels if each.occupancy)
    return sum(chain(images, rays, scans, cells, voxels))


def serve_scenes(
    scenario: Scenario,
    *,
    live: bool = False,
    dataset: Path | None = None,
    domain: int | None = None,
    exposure: Exposure = LOCAL,
    ros: RosArguments = PLAIN,
    observer: ProductionObserver = SILENT,
) -> Generator[Path, None, None]:
    """Start a graph and play the scenes that are asked for through service and action; yield the bags of recorded ones.

    The graph is restarted for a scene whose configuration needs other nodes, and after a failure, which is reported to
    the client. It runs until the generator is closed.

    Args:
        scenario: The configuration of the graph, and of orders without one.
        live: Paced by the wall clock instead of as fast as possible.
        dataset: Folder to record into; None: nothing is recorded.
        domain: ROS domain; None: that of the environment, else a free one.
        exposure: Who can take part in the graph.
        ros: ROS arguments of all nodes of the graph, and its namespace.
        observer: Receives the progress.

    Raises:
        InputError: The messages of service and action are not installed, or the folder cannot be written to.
        GraphError: A node died while no scene was played.
    """
    require_interfaces()
    _make_simulation_interfaces(observer)
    if dataset is not None:
        require_writable(dataset)
    queue = SceneQueue(OrderDrawer(scenario, dataset, observer).draw)
    with ExitStack() as held:
        graph = _Graph(live=live, dataset=dataset, domain=domain, exposure=exposure, ros=ros, serves=True)
        held.callback(graph.close)
        session = graph.session_for(scenario)
        observer.notify(GraphStarted(session.domain, session.security_variables))
        held.enter_context(scene_services(queue, scenario, session.domain, ros, recorded=dataset is not None))
        while not queue.is_quitting:
            ordered = queue.take(0.0)
            if ordered is None:
                graph.wait(_IDLE_S)
            elif (bag := _play(graph, ordered, dataset, observer, live=live)) is not None:
                yield bag


def _make_simulation_interfaces(observer: ProductionObserver) -> None:
    """Make the package if it is missing; tell the observer, also if that is impossible."""
    try:
        install_missing(
            lambda package: observer.notify(GraphWarned("scenes", f"making {package.name}, once")), SERVED_MESSAGES
        )
    except SimbevError as error:
        observer.notify(GraphWarned("scenes", f"its services are left out: {error}"))
    importlib.invalidate_caches()


class _Graph:
    """A running graph, which is replaced by another one where that is needed."""

    def __init__(self, **options: Any) -> None:
        self._options = options
        self._session: GraphSession | None = None

    def session_for(self, scenario: Scenario) -> GraphSession:
        """The running graph if it can play scenes of a configuration, else a new one."""
        if self._session is not None and not self._session.can_play(scenario):
            self.close()
        if self._session is None:
            self._session = GraphSession(scenario, **self._options)
            self._options["domain"] = self._session.domain
            self._session.start()
        return self._session

    def wait(self, duration_s: float) -> None:
        """Watch the graph, if it runs, while no scene is played."""
        if self._session is None:
            time.sleep(duration_s)
        else:
            self._session.wait(duration_s)

    def close(self) -> None:
        """Stop the graph."""
        if self._session is not None:
            self._session.close()
            self._session = None


def _play(
    graph: _Graph, ordered: OrderedScene, dataset: Path | None, observer: ProductionObserver, *, live: bool
) -> Path | None:
    """Play an ordered scene, report its end to the client, and return its bag, or None without one."""
    scenario, spec = ordered.scenario, ordered.spec
    is_stopped = False

    def follow(tick: int | None) -> None:
        nonlocal is_stopped
        ordered.note_progress(tick)
        if ordered.stop_reason is not None and not is_stopped:
            session.end_scene(ordered.stop_reason)
            is_stopped = True

    ordered.phase = Phase.LOADING
    try:
        with ExitStack() as held:
            if dataset is not None:
                held.enter_context(hold_record_folder(dataset, scenario, [spec], live=live, observer=observer))
            build_surroundings([spec], observer)
            require_free_stations(scenario, [spec])
            session = graph.session_for(scenario)
            try:
                end = play_on(
                    session, spec, observer, on_tick=follow, config=scenario, log_to=dataset, paused=ordered.paused
                )
            except SimbevError:
                graph.close()
                raise
        bag = None if dataset is None else scene_folder(dataset, spec.split, spec.name)
        if bag is not None and not bag.is_dir():  # live, where the graph does not wait for the recorder
            raise GraphError(f"node recorder has not left a bag: {bag}")
    except SimbevError as error:
        observer.notify(GraphWarned(spec.name, str(error)))
        ordered.finish(Outcome(success=False, message=str(error), last_tick=ordered.tick))
        return None
    path = "" if bag is None else str(bag.resolve())
    ordered.finish(Outcome(success=True, last_tick=end.tick, reason=end.reason, bag=path))
    return bag
