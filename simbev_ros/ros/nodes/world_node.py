"""The world node: owns simulated time and publishes the world state of every tick.

It receives a scene to simulate or replay and starts a tick when the participants have kept up (lockstep) or the wall
clock says so (live).
"""

import json
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from geometry_msgs.msg import Twist
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header, String
from std_srvs.srv import SetBool, Trigger

from simbev_ros.assets.regions.region_scene import Streetside
from simbev_ros.assets.regions.static_cache import load_streetside
from simbev_ros.config.agents import driver_participant
from simbev_ros.foundation.latest_value import LatestValue
from simbev_ros.foundation.process_memory import freeze_after_loading
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.conventions.simulation_interfaces import RUN_STATUS
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.drive import goal_message, route_message
from simbev_ros.ros.msgs.message_types import is_installed, message_class, require_installed
from simbev_ros.ros.msgs.qos import STATE_READER, STEERING, rclpy_qos
from simbev_ros.ros.msgs.robot_description import robot_description
from simbev_ros.ros.msgs.signing import content_of, signed_json
from simbev_ros.ros.msgs.stamps import stamp_of, time_message
from simbev_ros.ros.msgs.tables import message_from_table
from simbev_ros.ros.msgs.transforms import TransformBroadcaster
from simbev_ros.ros.msgs.vehicle_commands import COMMAND_KINDS, INDICATORS, CommandKind
from simbev_ros.ros.msgs.world import (
    MAP_FRAME,
    actors_message,
    agent_odometry,
    building_lights_message,
    event_message,
    lights_message,
    signals_message,
    weather_message,
)
from simbev_ros.ros.nodes.command_queue import CommandQueue
from simbev_ros.ros.nodes.driver_reports import DriverReports
from simbev_ros.ros.nodes.entity_services import EntityServices
from simbev_ros.ros.nodes.graph_node import GraphNode
from simbev_ros.ros.nodes.loaded_scene import LoadedScene, run_status
from simbev_ros.ros.nodes.lockstep import LockstepWindow
from simbev_ros.ros.nodes.pacer import Pacer
from simbev_ros.ros.nodes.reports import Report, read_report, subscribe_to_reports
from simbev_ros.ros.nodes.world_conditions import ConditionServices, RunningScene
from simbev_ros.ros.nodes.world_displays import WorldDisplays
from simbev_ros.scene.ending import SceneEndDetector
from simbev_ros.scene.legend import legend
from simbev_ros.scene.reach import loaded_reach
from simbev_ros.scene.request import SceneRequest, SceneStop
from simbev_ros.schema.scene.agents import AgentView, agent_views
from simbev_ros.schema.scene.drive_tables import ProgressTables, route_table, status_table
from simbev_ros.schema.scene.lights import street_lights
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import scene_number_of
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.replay.replay import Replay
from simbev_ros.simulation.world.driving.driven_vehicles import COMMAND_TIMEOUT_S
from simbev_ros.simulation.world.simulation import Simulation
from simbev_ros.simulation.world.source import StateSource

_CLOCK_PERIOD_S = 0.1
"""Wall time between messages on /clock while the world is paused."""


class WorldNode(GraphNode):
    """Plays one requested scene after the other."""

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        participants = self.declare_read_only(
            "participants", [], "Names of nodes that must report each tick on /sync/ready"
        )
        self._outside = frozenset(
            self.declare_read_only("outside_participants", [], "Those of them that need not sign their reports")
        )
        self._recorded = self.declare_read_only("recorded", False, "A recorder writes each scene into a bag")
        self._state_readers = self.declare_read_only(
            "state_readers", 0, "Number of readers of /world/actors to wait for before a scene", minimum=0
        )
        window_ticks = self.declare_read_only(
            "window_ticks", 3, "Number of ticks that the world may be ahead of the slowest participant", minimum=1
        )
        self._lockstep = LockstepWindow(participants, 1 if self.live else window_ticks, self._outside)
        max_factor = self.declare_read_only(
            "max_real_time_factor", 0.0, "Simulated time per wall time is at most this; 0: unlimited", minimum=0.0
        )
        self._pacer = Pacer(1.0 if self.live else max_factor)
        self._scene: LoadedScene | None = None
        self._networks = LatestValue[MapSpec, RoadNetwork]()
        self._commands: dict[str, Any] = {}
        self._driver_reports = DriverReports()
        self._next_tick = 0
        self._stop: SceneStop | None = None
        self._now = Clock()
        self._transforms = TransformBroadcaster(self)
        self.create_subscription(String, topics.REQUEST, self._on_request, rclpy_qos(STEERING))
        self.create_subscription(String, topics.STOP, self._on_stop, rclpy_qos(STEERING))
        subscribe_to_reports(self, self._on_ready, self._outside)
        self.create_service(SetBool, "/world/pause", self._pause)
        self.create_service(Trigger, "/world/step", self._step)
        self.create_service(Trigger, "/world/reset", self._reset)
        ConditionServices(self, self._running)
        self._serves = self.declare_read_only("serves", False, "It answers to simulation_interfaces")
        if self._serves:
            EntityServices(self, self._running)
            self.create_service(Trigger, RUN_STATUS, self._describe_run)
        self.create_wall_timer(0.005 if self._pacer.max_real_time_factor else 0.02, self.advance)
        self.create_wall_timer(_CLOCK_PERIOD_S, self._repeat_clock)

    def _on_request(self, message: String) -> None:
        if (request := self.read_request(message)) is not None:
            if self._serves:  # steps to the end of a scene leave it paused
                self._pacer.pause(request.paused)
            self.start(request)

    def start(self, request: SceneRequest) -> None:
        """Load a scene, announce it and simulate its warm-up; ticks start when all participants are connected."""
        self.close()
        with freeze_after_loading():
            views = agent_views(request.spec)
            source, displays = self._load(request, views)
        ending = SceneEndDetector(request.spec, source.available)
        progress = None if request.spec.drive is None else ProgressTables(request.spec.drive.route)
        network = self._networks.get(request.spec.map, lambda: load_network(request.spec.map))
        self._scene = LoadedScene(request, views, source, ending, displays, progress, *self._queues(views), network)
        for _ in range(request.spec.warm_up_ticks - request.spec.lead_in_ticks):
            self._scene.state = source.step()
        self._next_tick = -request.spec.lead_in_ticks
        self._driver_reports.start_scene(request.spec.number)
        self._now = Clock(clock=time_message(request.spec.stamp_ns(request.spec.loaded_tick)))
        self._pacer.start()
        if request.paused and self._pacer.paused:
            self.report_finished(request.spec, request.spec.loaded_tick)  # otherwise it would seem to be stuck
        self._end_if_asked()
        self.get_logger().info(f"scene {request.spec.name} is loaded")

    def _load(self, request: SceneRequest, views: Sequence[AgentView]) -> tuple[StateSource, WorldDisplays]:
        """Load and announce a scene; return the source of its states, and its displays."""
        spec = request.spec
        network = self._networks.get(spec.map, lambda: load_network(spec.map))
        for topic in (topics.end_topic(), *topics.world_topics(spec)):
            self.advertise(topic)
        self.advertise_derived(spec)
        self._transforms.start_scene(spec)
        for view in views if request.replay is None else ():
            self._follow_commands(view)
        self._lockstep.start_scene(spec)
        self.publish(topics.MAP, String(data=network.opendrive))
        for view in views:
            self.publish(topics.robot_description_topic(view).name, String(data=robot_description(view)))
        self.publish(topics.LEGEND, String(data=json.dumps(legend(network.signals))))
        streetside = load_streetside(spec.map, network, reach=loaded_reach(spec, network))
        lamps = street_lights(spec.lights, streetside.light_m)
        self.publish(topics.LIGHTS, lights_message(lamps, spec.start_ns))
        self.publish(topics.BUILDING_LIGHTS, building_lights_message(spec.lights.buildings))
        if spec.drive is not None:
            self.publish(topics.DRIVE_ROUTE, route_message(spec.drive.route, spec.start_ns))
            plan = message_from_table(route_table(spec.drive.route), spec.start_ns, MAP_FRAME)
            self.publish(topics.DRIVE_PLAN, plan)
            self.publish(topics.DRIVE_GOAL, goal_message(spec.drive.route, spec.start_ns))
        specification = spec.model_dump_json()
        self.publish(topics.SCENE, String(data=specification))
        self.publish_typed_once(topics.SCENE, specification, spec.start_ns)
        return _make_source(request, network, streetside), WorldDisplays(self, spec, lamps)

    def _follow_commands(self, view: AgentView) -> None:
        """Subscribe to the commands for an agent driven from outside; the subscription stays for later scenes."""
        if (kind := COMMAND_KINDS.get(view.spec.driver)) is not None:
            require_installed(kind.type, f"driver: {view.spec.driver}")
            self._listen(view.agent, kind, self._on_stamped_command)
            if is_installed(INDICATORS.type):
                self._listen(view.agent, INDICATORS, self._on_indicators)
            return
        command = topics.agent_topic(view.agent, "cmd_vel")
        if view.spec.driver == "twist" and command not in self._commands:
            drive = partial(self._on_command, view.agent)
            self._commands[command] = self.create_subscription(Twist, command, drive, 10)

    def _listen(self, agent: str, kind: CommandKind, receive: Callable[[str, str, CommandKind, Any], None]) -> None:
        """Subscribe to a kind of stamped commands for an agent, once."""
        topic = topics.agent_topic(agent, kind.name)
        if topic not in self._commands:
            take, qos = partial(receive, agent, topic, kind), rclpy_qos(STATE_READER)
            self._commands[topic] = self.create_subscription(message_class(kind.type), topic, take, qos)

    def _queues(self, views: Sequence[AgentView]) -> tuple[dict[str, CommandQueue], dict[str, CommandQueue]]:
        """Empty queues for the commands of drivers to vehicles and to indicators, by agent."""
        window_ticks = 0 if self.live else self._lockstep.window_ticks
        max_age_ticks = round(COMMAND_TIMEOUT_S * NS_PER_S / views[0].scene.tick_ns)
        driven = [view.agent for view in views if view.spec.driver in COMMAND_KINDS]
        vehicles, indicators = ({each: CommandQueue(window_ticks, max_age_ticks) for each in driven} for _ in range(2))
        return vehicles, indicators

    def _on_stop(self, message: String) -> None:
        stop = self.read(topics.STOP, content_of, SceneStop, message.data, self.signer)
        if stop is not None:
            self._stop = stop
            self._end_if_asked()

    def _end_if_asked(self) -> None:
        """Let the scene end with its next tick, also a paused one, if the supervisor has asked for it."""
        if self._scene is not None and self._stop is not None and self._stop.number == self._scene.request.number:
            if self._stop.without is not None:
                self._lockstep.release(self._stop.without)
                self.advance()
                return
            self._scene.ending.end_soon(self._stop.reason)
            self._pacer.pause(False)

    def _on_command(self, agent: str, message: Twist) -> None:
        if self._scene is not None and (vehicle := self._scene.vehicles.get(agent)) is not None:
            self._scene.source.drive_vehicle(vehicle, message.linear.x, message.angular.z)

    def _on_stamped_command(self, agent: str, topic: str, kind: CommandKind, message: Any) -> None:
        """Queue a command; it counts as the report of its driver, valid or not."""
        scene, stamp_ns, driver = self._scene, stamp_of(message.header.stamp), driver_participant(agent)
        if scene is None or agent not in scene.queues:
            return
        self.read(topic, self._driver_reports.check_stamp, driver, stamp_ns)
        report = self._driver_reports.take_held(driver)
        if scene_number_of(stamp_ns) == scene.spec.number:
            if (command := self.read(topic, kind.read, message)) is not None:
                self.read(topic, scene.queues[agent].add, scene.spec.tick_of(stamp_ns), command, self._next_tick)
            report = Report(driver, scene.spec.name, stamp_ns)
        if report is not None:
            self._lockstep.record_report(report, self._next_tick - 1)
            self.advance()

    def _on_indicators(self, agent: str, topic: str, kind: CommandKind, message: Any) -> None:
        """Queue a command to indicators, which is not a report: senders make sure that it arrives before theirs."""
        scene, stamp_ns = self._scene, stamp_of(message.header.stamp)
        if scene is not None and agent in scene.indicators and scene_number_of(stamp_ns) == scene.spec.number:
            queue, tick = scene.indicators[agent], scene.spec.tick_of(stamp_ns)
            self.read(topic, queue.add, tick, kind.read(message), self._next_tick)

    def _is_driving(self, node: str) -> bool:
        """Whether a node sends stamped commands to a vehicle, and has loaded the scene."""
        queues = self._scene.queues if self._scene is not None else {}
        return self._lockstep.finished_tick(node) is not None and node in map(driver_participant, queues)

    def _on_ready(self, message: Header) -> None:
        report = self.read(topics.READY, read_report, message, self.signer, self._outside)
        if report is not None and (not self._is_driving(report.node) or self._driver_reports.counts(report)):
            self._lockstep.record_report(report, self._next_tick - 1)
            self.advance()

    def advance(self) -> None:
        """Start all ticks that participants, pause and the wall clock (live) allow."""
        scene = self._scene
        while scene is not None and self._may_start_tick(scene):
            self._tick(scene)

    def _may_start_tick(self, scene: LoadedScene) -> bool:
        if scene.end is not None:
            return False
        if self._next_tick == -scene.spec.lead_in_ticks and not self._connected():
            return False
        # A live scene waits for all participants once: tick 0 starts when all have processed the lead-in.
        together = not self.live or self._next_tick <= 0
        if together and not self._lockstep.may_start(self._next_tick):
            return False
        return self._pacer.take_due(scene.spec.tick_ns)

    def _connected(self) -> bool:
        names = (topics.ACTORS, topics.SIGNALS, topics.WEATHER)
        recorded = not self._recorded or self.reader_count(topics.EVENTS) > 0
        return recorded and all(self.reader_count(name) >= self._state_readers for name in names)

    def _tick(self, scene: LoadedScene) -> None:
        with self.meter.busy():
            with self.meter.part("simulate"):
                for agent, queue in (*scene.indicators.items(), *scene.queues.items()):
                    for command in queue.take(self._next_tick):
                        scene.source.follow_command(scene.vehicles[agent] or 0, command)
                scene.state = state = scene.source.step()
                scene.end = scene.ending.end_at(state)
            if scene.end is not None:  # published first: all nodes know it before they can finish the last tick
                self.publish(topics.END, String(data=signed_json(scene.end, self.signer)))
            with self.meter.part("message"):
                self._publish_state(scene, state)
        self.report_finished(scene.spec, self._next_tick)
        self._log_progress(scene)
        self._next_tick += 1

    def _log_progress(self, scene: LoadedScene) -> None:
        """Log the first tick of a scene and its end."""
        if self._next_tick == 0:
            self.get_logger().info(f"scene {scene.spec.name} starts: {scene.spec.ticks} ticks")
        if scene.end is not None:
            self.get_logger().info(f"scene {scene.spec.name} ends with tick {scene.end.tick}: {scene.end.reason}")

    def _repeat_clock(self) -> None:
        """Publish the time again while the world is paused: nodes that are started then would stay at time 0."""
        if self._pacer.paused and self._scene is not None and self._scene.end is None:
            self.publish(topics.CLOCK, self._now)

    def _publish_state(self, scene: LoadedScene, state: WorldState) -> None:
        for event in state.events:  # first, so that they arrive well before the tick is finished
            self.publish(topics.EVENTS, event_message(event, state))
        self._now = Clock(clock=time_message(state.stamp_ns))
        self.publish(topics.CLOCK, self._now)
        self.publish(topics.ACTORS, actors_message(state))
        self.publish(topics.SIGNALS, signals_message(state))
        self.publish(topics.WEATHER, weather_message(state))
        odometries = [agent_odometry(view, state.actors, state.stamp_ns) for view in scene.views]
        for odometry in odometries:
            scene.signs.keep(odometry.child_frame_id, state.tick, odometry.pose.pose.orientation)
        scene.displays.publish(state, odometries)
        for view, odometry in zip(scene.views, odometries, strict=True):
            self.publish(topics.odometry_name(view.agent), odometry)
            if view.reports_status:
                status = message_from_table(status_table(view.ego_row(state.actors)), state.stamp_ns, MAP_FRAME)
                self.publish(topics.vehicle_status_topic(view).name, status)
        if scene.progress is not None:
            progress = message_from_table(scene.progress.table_at(state.ego), state.stamp_ns, MAP_FRAME)
            self.publish(topics.DRIVE_PROGRESS, progress)
        self._transforms.publish(odometries)

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._pacer.pause(request.data)
        response.success, response.message = True, "paused" if request.data else "running"
        self.get_logger().info(f"{response.message}; the next tick is {self._next_tick}")
        return response

    def _step(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        refusal = self._refusal()
        if refusal is None and not self._pacer.paused:
            refusal = "pause first: /world/pause"
        response.success, response.message = refusal is None, refusal or f"tick {self._next_tick + self._pacer.steps}"
        if response.success:
            self._pacer.steps += 1
        return response

    def _reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        refusal = self._refusal()
        if refusal is None and not self.live:
            refusal = "only a live scene can start again; in lockstep all nodes are in the middle of this one"
        elif refusal is None and self._recorded:
            refusal = "a scene that is recorded cannot start again"
        response.success = refusal is None
        response.message = refusal or "restarted"
        if refusal is None and self._scene is not None:
            self.get_logger().info(f"scene {self._scene.spec.name} starts again")
            self.start(self._scene.request)
            self.publish(topics.CLOCK, self._now)  # before any message with an earlier stamp: listeners clear buffers
        return response

    def _describe_run(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = True
        response.message = run_status(self._scene, self._next_tick, self._pacer.paused, self._lockstep)
        return response

    def _running(self) -> RunningScene | None:
        """The scene that runs; None if none has been loaded, or it has ended."""
        scene = self._scene
        if scene is None or scene.end is not None:
            return None
        return RunningScene(scene.spec, scene.source, self._next_tick, scene.network, scene.state)

    def _refusal(self) -> str | None:
        """Why the scene can neither be stepped nor restarted; None if it can."""
        if self._scene is None:
            return "no scene has been loaded yet"
        return None if self._scene.end is None else "the scene has ended"

    def close(self) -> None:
        """End the simulation or the replay."""
        if self._scene is not None:
            self._scene.source.close()
            self._scene = None


def _make_source(request: SceneRequest, network: RoadNetwork, streetside: Streetside) -> StateSource:
    """Make the simulation of a scene, or the replay of its bag."""
    spec = request.spec
    if request.replay is not None:
        return Replay(spec, Path(request.replay))
    return Simulation(spec, network, *streetside[1:])
