"""Runs a graph: starts its processes, plays scenes on them, supervises them, and stops them without leftovers."""

import json
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from rclpy.impl.implementation_singleton import rclpy_implementation

from simbev_ros.config.camera import Camera
from simbev_ros.config.rendering import Rendering
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import GraphError, InputError
from simbev_ros.foundation.loopback import require_loopback
from simbev_ros.foundation.process_limits import require_graph_limits
from simbev_ros.foundation.threads import usable_cores
from simbev_ros.recording.layout import scene_folder
from simbev_ros.recording.reader import SceneBag
from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments
from simbev_ros.ros.conventions.simulation_interfaces import has_simulation_interfaces
from simbev_ros.ros.graph.domain import DomainLock
from simbev_ros.ros.graph.driver import DRIVER, dispensable_driver, driver_commands
from simbev_ros.ros.graph.environment import graph_environment
from simbev_ros.ros.graph.evaluated_stack import require_stacks, stack_commands
from simbev_ros.ros.graph.exposure import LOCAL, NEEDS_SROS, Exposure
from simbev_ros.ros.graph.loading_watch import LoadingWatch
from simbev_ros.ros.graph.monitor import SUPERVISOR, GraphMonitor
from simbev_ros.ros.graph.node_starter import NodeStarter
from simbev_ros.ros.graph.pace_watch import PaceWatch
from simbev_ros.ros.graph.plan import WRITERS, ProcessPlan, figures_file, plan_processes
from simbev_ros.ros.graph.process import GraphProcess, NodeProcess, StackProcess
from simbev_ros.ros.graph.resources import GraphResources
from simbev_ros.ros.msgs.signing import KEY_VARIABLE, Signer, make_key
from simbev_ros.scene.ending import SceneEnd
from simbev_ros.scene.request import SceneRequest
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.render.shares import camera_processes, drawing_environment

_POLL_S = 0.1
_STOP_TIMEOUT_S = 8.0
_LIVE_PATIENCE_S, _LIVE_EVALUATION_PATIENCE_S = 2.0, 6.0
"""Maximum time that a live recorder waits for the last messages, which may be lost; with an evaluator, for answers."""

Progress = Callable[[int | None], None]
"""Called with the last tick that every participant has finished; None while they load the scene."""


class GraphSession:
    """The processes of one graph, reused from scene to scene.

    ``close`` stops them and removes their files in shared memory; as a context manager the session starts on entry and
    closes on exit.

    Args:
        scenario: The configuration.
        live: Whether the world is paced by the wall clock and sensor topics are best effort.
        dataset: Folder into which scenes are recorded; None: they are not recorded.
        domain: ROS domain; None: that of the environment, else a free one.
        exposure: Who can take part in the graph.
        rendering: Devices and processes that render, in place of the configuration's, which is recorded all the same.
        ros: ROS arguments of all nodes, and the graph's namespace.
        serves: Whether other nodes steer the graph, also through simulation_interfaces if it is installed.

    Attributes:
        security_variables: Environment variables with which other nodes can take part in a secure graph.
        has_lost_driver: Whether the driver of a drive has died or was given up, so that it drives no scene again.
        figures: After ``close``, figures of each evaluated stack (``evaluation.live.live_figures``).
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        live: bool = False,
        dataset: Path | None = None,
        domain: int | None = None,
        exposure: Exposure = LOCAL,
        rendering: Rendering | None = None,
        ros: RosArguments = PLAIN,
        serves: bool = False,
    ) -> None:
        ros.require_valid()
        self._ros = ros
        self._scenario, self._exposure = scenario, exposure
        self._rendering = rendering or scenario.rendering
        self._live, self._serves = live, serves and has_simulation_interfaces()
        self._dataset = dataset
        self._lock = DomainLock(domain, ros.namespace)
        self.domain = self._lock.domain
        self._resources = GraphResources()
        self._starter: NodeStarter | None = None
        self._plans: list[ProcessPlan] = []
        self._processes: list[GraphProcess] = []
        self._monitor: GraphMonitor | None = None
        self._loading: LoadingWatch | None = None
        self._failed = self.has_lost_driver = False
        self._driver = dispensable_driver(scenario)
        self._is_driven, self._news = self._driver is not None, list[str]()
        self.security_variables: dict[str, str] = {}
        self.figures: list[dict[str, Any]] = []

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def start(self) -> None:
        """Start the processes; if one of them fails to start, stop the others.

        Raises:
            InputError: A limit of this process is too low, the loopback interface is down, the included stack cannot
                run, or SROS 2 is missing but the graph has to be secure.
            RenderError: The configured devices cannot draw.
        """
        try:
            require_graph_limits()
            if not self._exposure.network:
                require_loopback()
            require_stacks(self._scenario)
            self._start_processes()
        except BaseException:
            self.close()
            raise

    def _start_processes(self) -> None:
        environment = graph_environment(self.domain, self._exposure)
        self.security_variables = self._exposure.security_environment(self._resources.folder)
        environment |= self.security_variables
        os.environ.update(environment)  # for the monitor: the middleware reads them when the first node is created
        environment |= drawing_environment(self._camera_processes(self._scenario))
        self._plans = plans = self._plan(self._scenario)
        key = make_key()
        kinds_of_all = (node.kind for nodes in plans for node in nodes)
        self._starter = NodeStarter(kinds_of_all, self._resources.folder, {**environment, KEY_VARIABLE: key})
        for nodes in plans:
            self._processes.append(NodeProcess(self._starter, nodes, self._resources.folder, self._ros))
        for label, command in stack_commands(self._scenario, self._ros, live=self._live).items():
            self._processes.append(StackProcess(self._starter, label, command, self._resources.folder))
        for label, command in driver_commands(self._scenario, self._ros, live=self._live).items():
            self._processes.append(StackProcess(self._starter, label, command, self._resources.folder, "drive.stack"))
        names = [node.ros_name(self._ros.namespace) for nodes in plans for node in nodes]
        reporting = [*(name.name for name in names[1:]), *self._scenario.participants]
        writers = [node.name for nodes in plans for node in nodes if node.kind in WRITERS]
        pace = PaceWatch(self._scenario.graph.real_time_factor(live=self._live), live=self._live)
        try:
            self._monitor = GraphMonitor(
                self.domain, names, reporting, Signer(key), self._ros, writers=writers, pace=pace
            )
        except rclpy_implementation.RCLError as error:
            if os.environ.get("ROS_SECURITY_ENABLE") != "true":
                raise
            remedy = NEEDS_SROS if self.security_variables else "unset ROS_SECURITY_ENABLE, or use --security"
            raise InputError(f"{str(error).splitlines()[0]}; {remedy}") from None
        self._resources.note([os.getpid()])

    def _camera_processes(self, scenario: Scenario) -> int:
        return camera_processes(self._rendering, len(scenario.sensors_of_type(Camera)))

    def _plan(self, scenario: Scenario) -> list[ProcessPlan]:
        """Plan the processes for a configuration."""
        return plan_processes(
            scenario,
            self._camera_processes(scenario),
            live=self._live,
            dataset=self._dataset,
            figures=self._resources.folder,
            rendering=self._rendering,
            cores=usable_cores(),
            serves=self._serves,
        )

    def can_play(self, scenario: Scenario) -> bool:
        """Whether the running processes are those that a configuration needs; only its scenes may differ."""
        return scenario.graph == self._scenario.graph and _comparable(self._plan(scenario)) == _comparable(self._plans)

    def play(
        self,
        spec: SceneSpec,
        progress: Progress,
        replay: Path | None = None,
        config: Scenario | None = None,
        *,
        paused: bool = False,
    ) -> SceneEnd:
        """Play a scene to its end and return the end.

        Args:
            spec: The scene.
            progress: Called several times per second.
            replay: A bag to take all motion from; None: motion is simulated.
            config: The scene's configuration, if it is not that of the graph.
            paused: Whether the world waits before the first tick.

        Raises:
            InputError: A node cannot do what is configured, or not on this machine; the message says what to change.
            DiskError: The disk is full, or nearly.
            GraphError: A node died or was silent for too long; the message names it.
        """
        self._loading = LoadingWatch(time.monotonic(), self._scenario.graph.silence_timeout_s)
        path = None if replay is None else str(replay.resolve())
        text = None if config is None else config.as_yaml()
        self.monitor.request(SceneRequest(spec=spec, replay=path, config=text, paused=paused))
        self._is_driven = self._driver is not None
        while (end := self.monitor.end) is None or not self._finished(end.tick):
            tick = self._finished_tick()
            progress(tick)
            self.monitor.spin(_POLL_S)
            self._check(tick)
        progress(end.tick)
        self._await_files(end.tick)
        if self._dataset is not None and not self._live:
            self._check_bag(scene_folder(self._dataset, spec.split, spec.name), end)
        return end

    def end_scene(self, reason: str) -> None:
        """Let the scene that is being played end with its next tick, for a reason in words."""
        self.monitor.stop(reason)

    def end_interrupted(self) -> None:
        """Let a scene that is interrupted end in order, within some seconds, so that its bag is complete."""
        tick, end_s = self._finished_tick(), time.monotonic() + _STOP_TIMEOUT_S
        if tick is not None and tick >= 0:
            self.end_scene("interrupted")
            while not ((end := self.monitor.end) and self._has_files(end.tick)) and time.monotonic() < end_s:
                self.monitor.spin(_POLL_S)

    def wait(self, duration_s: float) -> None:
        """Watch the processes while no scene is played.

        Raises:
            InputError: A node cannot do what is configured.
            GraphError: A node died.
        """
        self.monitor.spin(duration_s)
        self._check_processes("while it waited for a scene")

    def _check_bag(self, folder: Path, end: SceneEnd) -> None:
        """Fail unless the recorder has left the whole scene, which its reports alone do not prove."""
        if not folder.is_dir():
            self._fail(f"node recorder has not left a bag: {folder}")
        with SceneBag(folder) as bag:
            facts = bag.custom_data
        if (facts.get("complete"), facts.get("ticks")) != ("true", str(end.tick + 1)):
            self._fail(f"{folder} is not complete: {facts.get('problems', 'nothing is known of its messages')}")

    def _finished(self, tick: int) -> bool:
        done = self._finished_tick()
        return done is not None and done >= tick

    def _has_files(self, last_tick: int) -> bool:
        """Whether bag and figures are written, which recorder and evaluator report as one more tick."""
        writers = self.monitor.writers
        return not writers.laggards() or ((done := writers.finished_by_all()) is not None and done > last_tick)

    def _await_files(self, last_tick: int) -> None:
        """Wait until bag and figures are written."""
        live_s = _LIVE_EVALUATION_PATIENCE_S if self._scenario.evaluated_agents else _LIVE_PATIENCE_S
        patience_s = live_s if self._live else self._scenario.graph.silence_timeout_s
        end_s = time.monotonic() + patience_s
        while not self._has_files(last_tick):
            if time.monotonic() > end_s:
                if not self._live:
                    late = self.monitor.writers.laggards()
                    files = "its file" if len(late) == 1 else "their files"
                    waited = f"within {patience_s:g} s, after tick {last_tick}"
                    self._fail(f"{_nodes_have(late)} not closed {files} {waited}")
                return
            self.monitor.spin(_POLL_S)
            self._check(last_tick)

    @property
    def monitor(self) -> GraphMonitor:
        """The view of the running graph."""
        assert self._monitor is not None, "the session has not been entered"
        return self._monitor

    def new_output(self) -> dict[str, str]:
        """Return the output of every process since the last call, by process label."""
        return {process.label: process.new_output() for process in self._processes}

    def new_warnings(self) -> list[tuple[str, str]]:
        """Node and text of the warnings that the nodes have logged since the last call."""
        return [warning for process in self._processes for warning in process.new_warnings()]

    def new_losses(self) -> list[str]:
        """Why drives go on without their drivers; each sentence is returned once."""
        news, self._news = self._news, []
        return news

    def new_advice(self) -> list[str]:
        """Advice for nodes outside that the graph has been waiting for; each sentence is returned once."""
        return self.monitor.new_advice()

    def cpu_s(self) -> dict[str, float]:
        """Processor time of every process, s, by process label."""
        return {process.label: process.cpu_s for process in self._processes}

    def memory_mib(self) -> dict[str, float]:
        """Resident memory of every process, MiB, by process label."""
        return {process.label: process.memory_mib for process in self._processes}

    @property
    def folder(self) -> Path:
        """Temporary folder of the graph, with its logs."""
        return self._resources.folder

    def pids(self) -> dict[str, int]:
        """Ids of all processes of the graph that have been started, by label, with supervisor and fork server."""
        servers = {} if self._starter is None else {"fork server": self._starter.pid}
        nodes = {process.label: process.pid for process in self._processes if process.pid is not None}
        return {SUPERVISOR: os.getpid(), **servers, **nodes}

    def _finished_tick(self) -> int | None:
        """The last tick finished by all participants; live, where they may skip ticks, by the world node alone."""
        if not self._live:
            return self.monitor.behind_world.finished_by_all()
        return self.monitor.world.finished_by_all()

    def _check(self, tick: int | None) -> None:
        where = "while the scene was loading" if tick is None else f"after tick {tick}"
        self._check_processes(where)
        timeout_s = self._scenario.graph.silence_timeout_s
        if tick is None and self._loading is not None:
            self.monitor.note_computing(self._loading.computing(time.monotonic(), self.cpu_s()))
        silent = self.monitor.silent_nodes(timeout_s)
        if self._is_driven and silent == [self._driver]:
            self._drive_on(f"node {self._driver} has been silent for {timeout_s:g} s, {where}")
        elif silent:
            words = [f"{_nodes_have(silent)} been silent for {timeout_s:g} s, {where}", *self.monitor.advice(silent)]
            self._fail("; ".join(words))

    def _check_processes(self, where: str) -> None:
        """Fail if a process has died."""
        self._resources.note(self._pids())
        if self._starter is not None and (failure := self._starter.failure()):
            self._fail(f"{failure}, {where}")
        for process in self._processes:
            if process.exit_code is not None and process.label == DRIVER:
                if self._is_driven:
                    self._drive_on(f"{process.title} died {where}: {process.describe_end()}")
            elif process.exit_code is not None:
                if refusal := process.refusal():
                    raise refusal
                self._fail(f"{process.title} died {where}: {process.describe_end()}")

    def _drive_on(self, why: str) -> None:
        """Let the drive go on without its driver."""
        self._is_driven, self.has_lost_driver = False, True
        self.monitor.release(self._driver or "", why)
        self._news.append(f"{why}; the drive goes on without it")

    def _pids(self) -> list[int]:
        """Ids of this process and of those that have been started."""
        return [os.getpid(), *(process.pid for process in self._processes if process.pid is not None)]

    def _fail(self, message: str) -> None:
        self._failed = True
        raise GraphError(f"{message}\nlogs: {self._resources.folder}")

    def close(self) -> None:
        """Stop all processes, with time for the recorder to finish, and remove all traces except logs of a failure."""
        self._resources.note(self._pids())
        for process in self._processes:
            process.terminate()
        end_s = time.monotonic() + _STOP_TIMEOUT_S
        for process in self._processes:
            process.join(max(end_s - time.monotonic(), 0.1))
        if self._starter is not None:
            self._starter.close()
        files = [figures_file(self._resources.folder, agent) for agent in self._scenario.evaluated_agents]
        self.figures = [json.loads(file.read_text(encoding="utf-8")) for file in files if file.is_file()]
        if self._monitor is not None:
            self._monitor.close()
        self._resources.remove(keep_logs=self._failed)
        self._lock.close()


def _comparable(plans: Sequence[ProcessPlan]) -> list[ProcessPlan]:
    """Plans without the configuration that a recorder attaches, which a request for a scene can replace."""
    return [tuple(replace(node, parameters={**node.parameters, "config": ""}) for node in process) for process in plans]


def _nodes_have(names: Sequence[str]) -> str:
    """Subject and auxiliary verb of a sentence about one or several nodes."""
    return f"node {names[0]} has" if len(names) == 1 else f"nodes {', '.join(names)} have"
