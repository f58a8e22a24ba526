"""The world node: owns time. Gets a drawn scene, simulates it, and starts a tick when all participants may follow."""

from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header, String
from std_srvs.srv import SetBool, Trigger

from simbev_ros.maps.build import load_network
from simbev_ros.msgs import topics
from simbev_ros.msgs.qos import LATCHED, rclpy_qos
from simbev_ros.msgs.stamps import stamp_of, time_message
from simbev_ros.msgs.transforms import TransformBroadcaster
from simbev_ros.msgs.world import actors_message, odometry_message, signals_message, weather_message
from simbev_ros.nodes.graph_node import GraphNode
from simbev_ros.nodes.lockstep import Lockstep
from simbev_ros.nodes.pacer import Pacer
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.world.simulation import Simulation

_MESSAGE_TYPES = {
    topics.SCENE: String,
    topics.MAP: String,
    topics.CLOCK: Clock,
    topics.ACTORS: PointCloud2,
    topics.SIGNALS: PointCloud2,
    topics.WEATHER: String,
}


class WorldNode(GraphNode):
    """Simulates one requested scene after the other."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        participants = self.declared("participants", [], "Nodes on /sync/ready that must finish each tick")
        self._state_readers = self.declared("state_readers", 0, "Readers of /world/actors to wait for before a scene")
        window_ticks = self.declared("window_ticks", 3, "Ticks that the world may be ahead of the slowest participant")
        self._lockstep = Lockstep(participants, 1 if self.live else window_ticks)
        self._pacer = Pacer(live=self.live)
        self._simulation: Simulation | None = None
        self._spec: SceneSpec | None = None
        self._next_tick = 0
        self._transforms = TransformBroadcaster(self)
        ready_qos = rclpy_qos(LATCHED)
        ready_qos.depth = 64
        self.create_subscription(String, topics.REQUEST, self._on_request, rclpy_qos(LATCHED))
        self.create_subscription(Header, topics.READY, self._on_ready, ready_qos)
        self.create_service(SetBool, "/world/pause", self._pause)
        self.create_service(Trigger, "/world/step", self._step)
        self.create_service(Trigger, "/world/reset", self._reset)
        self.create_wall_timer(0.005 if self.live else 0.02, self.advance)

    def _on_request(self, message: String) -> None:
        self._start(SceneSpec.model_validate_json(message.data))

    def _start(self, spec: SceneSpec) -> None:
        """Load a scene, simulate its warm-up, and let everybody know; nothing is published before all are connected."""
        self.close()
        network = load_network(spec.map)
        for topic in topics.world_topics(spec):
            self.advertise(topic, _MESSAGE_TYPES.get(topic.name, Odometry))
        self._transforms.start_scene(spec)
        self._spec = spec
        self._lockstep.start_scene(spec)
        self.publish(topics.MAP, String(data=network.opendrive))
        self.publish(topics.SCENE, String(data=spec.model_dump_json()))
        self._simulation = Simulation(spec, network)
        for _ in range(spec.warm_up_ticks - spec.lead_in_ticks):
            self._simulation.step()
        self._next_tick = -spec.lead_in_ticks
        self._pacer.start()

    def _on_ready(self, message: Header) -> None:
        self._lockstep.finished(message.frame_id, stamp_of(message.stamp))
        self.advance()

    def advance(self) -> None:
        """Start as many ticks as participants, pause and the wall clock (live) allow."""
        while self._may_start_tick():
            self._tick()

    def _may_start_tick(self) -> bool:
        spec = self._spec
        if spec is None or self._simulation is None or self._next_tick >= spec.ticks:
            return False
        if self._next_tick == -spec.lead_in_ticks and not self._connected():
            return False
        # A live scene waits for everybody once: its first tick starts when all have warmed up on the lead-in.
        together = not self.live or self._next_tick <= 0
        if together and not self._lockstep.may_start(self._next_tick):
            return False
        return self._pacer.due(spec.tick_ns)

    def _connected(self) -> bool:
        names = (topics.ACTORS, topics.SIGNALS, topics.WEATHER)
        return all(self.readers(name) >= self._state_readers for name in names)

    def _tick(self) -> None:
        assert self._spec is not None and self._simulation is not None
        with self.meter.busy():
            self._publish_state(self._spec, self._simulation.step())
        self.report_finished(self._spec, self._next_tick)
        self._next_tick += 1

    def _publish_state(self, spec: SceneSpec, state: WorldState) -> None:
        agent = spec.rig.agent
        self.publish(topics.CLOCK, Clock(clock=time_message(state.stamp_ns)))
        self.publish(topics.ACTORS, actors_message(state))
        self.publish(topics.SIGNALS, signals_message(state))
        self.publish(topics.WEATHER, weather_message(state))
        odometry = odometry_message(state.ego, state.stamp_ns, f"{agent}/base_link")
        self.publish(topics.agent_topic(agent, "odom"), odometry)
        self._transforms.publish(odometry)

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._pacer.paused = request.data
        response.success = True
        response.message = "paused" if request.data else "running"
        return response

    def _step(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._pacer.paused and self._spec is not None
        response.message = f"tick {self._next_tick}" if response.success else "pause first: /world/pause"
        if response.success:
            self._pacer.steps += 1
        return response

    def _reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._spec is not None and self.live
        response.message = "restarted" if response.success else "only a live scene can start again"
        if self._spec is not None and response.success:
            self._start(self._spec)
        return response

    def close(self) -> None:
        """End the simulation."""
        if self._simulation is not None:
            self._simulation.close()
            self._simulation = None
