"""The base class of sensor and annotation nodes, which follow the world node tick by tick.

A participant receives each scene, then the world state of every tick in order, processes it, and reports it as
finished on /sync/ready. In lockstep the world waits for these reports.
"""

from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import replace
from itertools import chain
from typing import Any, NamedTuple

from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from simbev_ros.config.rig import S
from simbev_ros.config.scenario import RecordedTopics
from simbev_ros.config.sensor import Sensor
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.tick_join import TickJoin, all_of
from simbev_ros.foundation.types import Table
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.annotation_topics import Label, annotator_inputs
from simbev_ros.ros.msgs.displays import recorded_displays
from simbev_ros.ros.msgs.joint_topics import joint_inputs
from simbev_ros.ros.msgs.qos import STATE, STATE_READER, rclpy_qos
from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.ros.msgs.world import actors_from_message, signals_from_message, weather_from_message
from simbev_ros.ros.nodes.graph_node import GraphNode
from simbev_ros.schema.scene.agents import AgentView, agent_views
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID, WorldState

_MAX_UNSENT = 1
"""Lockstep: number of ticks whose messages threads may still prepare while the next tick is processed."""
_PATTERNS = "topics as in a shell: * and ? stand for any characters"


class _Unsent(NamedTuple):
    """A tick whose messages threads prepare."""

    spec: SceneSpec
    tick: int
    work: Sequence[Future[Any]]
    send: Callable[[], None]

    @property
    def is_prepared(self) -> bool:
        return all(future.done() for future in self.work)


class Participant(GraphNode):
    """Base of the sensor and annotation nodes.

    A subclass advertises its topics in ``start_scene`` and publishes in ``process``. It serves all agents of a
    scene, or a share of them; ``AgentView.ego_state`` makes one of them the ego of a state.

    Attributes:
        inputs: Subscriptions that must be connected before a scene starts.
    """

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._share, self._shares = self._declare_share()
        self.recorded: bool = self.declare_read_only(
            "recorded", False, "A recorder reads the recorded topics: wait until it is connected"
        )
        include = self.declare_read_only(
            "include_topics",
            [],
            "Patterns of which a recorded topic matches at least one; none: every topic is recorded",
            allowed=_PATTERNS,
        )
        exclude = self.declare_read_only(
            "exclude_topics", [], "Patterns that no recorded topic matches", allowed=_PATTERNS
        )
        self._recorded_topics = topics.TopicFilter(
            RecordedTopics(include=tuple(include or ["*"]), exclude=tuple(exclude))
        )
        self.annotated: bool = self.declare_read_only(
            "annotated", False, "An annotator reads clouds, instance images or views: wait until it is connected"
        )
        self._box_readers: int = self.declare_read_only(
            "box_readers",
            0,
            "Number of nodes that read the boxes of all agents, if there are several: wait until they are connected",
            minimum=0,
        )
        self._evaluated = self.declare_read_only(
            "evaluated_topics", [], "An evaluator reads these: wait until it is connected"
        )
        self.spec: SceneSpec | None = None
        self._awaited_readers: dict[str, int] = {}
        self._annotated_periods: dict[str, int] = {}
        self._loaded_reported = False
        self._last_tick = 0
        self._unsent: deque[_Unsent] = deque()
        self._join = _new_join()
        state_qos = rclpy_qos(replace(STATE, depth=1) if self.live else STATE_READER)
        self.follow_scenes(self._on_scene)
        self.inputs = [
            self.create_subscription(PointCloud2, topics.ACTORS, self._on_actors, state_qos),
            self.create_subscription(PointCloud2, topics.SIGNALS, self._on_signals, state_qos),
            self.create_subscription(String, topics.WEATHER, self._on_weather, state_qos),
        ]
        self.create_wall_timer(0.05, self._report_loaded)

    def _declare_share(self) -> tuple[int, int]:
        """Index and number of the shares into which nodes like this one divide the agents."""
        share = self.declare_read_only("agent_share", 0, "Index of the share of the agents that is served", minimum=0)
        shares = self.declare_read_only(
            "agent_shares", 1, "Number of nodes like this one, which share the agents among them", minimum=1
        )
        if share >= shares:
            raise InputError(f"parameter agent_share: must be less than agent_shares, which is {shares}")
        return share, shares

    def served_views(self, spec: SceneSpec, kind: type[Sensor] | None = None) -> tuple[AgentView, ...]:
        """Views of the agents that this node serves: its share of those with sensors of a kind, or of all (None)."""
        views = [view for view in agent_views(spec) if kind is None or view.rig.of_type(kind)]
        return tuple(views[self._share :: self._shares])

    def served_sensors(self, spec: SceneSpec, kind: type[S]) -> Iterator[tuple[AgentView, S]]:
        """The sensors of a kind that this node serves, each with the view of the agent that carries it."""
        for view in self.served_views(spec, kind):
            for sensor in view.rig.of_type(kind):
                yield view, sensor

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Load what a scene needs and advertise its topics; return the names of the topics that can be recorded.

        Args:
            spec: The scene.
        """
        raise NotImplementedError

    def is_due(self, spec: SceneSpec, tick: int) -> bool:
        """Whether the node publishes anything at a tick; at other ticks its load is not measured."""
        return tick >= 0

    def is_sensed(self, tick: int) -> bool:
        """Whether to draw or cast at a tick; in the lead-in only live, so that the first sample is not late."""
        return tick >= 0 or self.live

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Do the work of one tick, including lead-in ticks (negative, nothing is published).

        Args:
            spec: The scene.
            state: The state, with the scene's first agent as the ego.
        """
        raise NotImplementedError

    def finish(self, spec: SceneSpec, state: WorldState) -> None:
        """Report a processed tick; override it if the node has more to do before the tick is finished."""
        self.report_finished(spec, state.tick)

    def finish_after(self, spec: SceneSpec, tick: int, work: Sequence[Future[Any]], send: Callable[[], None]) -> None:
        """Send a tick's messages and report it as soon as threads have done their work for it, in the order of ticks.

        In lockstep the next tick may be processed meanwhile.

        Args:
            spec: The scene.
            tick: The tick.
            work: What threads do for it.
            send: Publishes the messages.
        """
        unsent = _Unsent(spec, tick, work, send)
        self._unsent.append(unsent)
        self._send(0 if self.live else _MAX_UNSENT)
        if self._unsent:
            for future in work:
                future.add_done_callback(lambda _: self._send_soon(unsent))

    def _send_soon(self, unsent: _Unsent) -> None:
        """Send a tick if it is prepared; called by the threads."""
        if unsent.is_prepared:
            self.call_soon(self._send)

    def _send(self, max_unsent: int = _MAX_UNSENT) -> None:
        """Send the ticks that are prepared, in order; of others, leave at most this number."""
        while self._unsent and (self._unsent[0].is_prepared or len(self._unsent) > max_unsent):
            unsent = self._unsent.popleft()
            with self.meter.busy(ticks=0), self.meter.part("message"):
                unsent.send()
            self.report_finished(unsent.spec, unsent.tick)

    def _on_scene(self, specification: str, _: bytes) -> None:
        self.spec = None
        self._unsent.clear()
        self._join = _new_join()
        spec = SceneSpec.from_json(specification)
        names = self.start_scene(spec)
        periods = dict(chain.from_iterable(map(_annotated_periods, agent_views(spec))))
        self._annotated_periods = {name: periods[name] for name in names if self.annotated and name in periods}
        self._awaited_readers = self._expected_readers(spec, names)
        self.get_logger().info(f"scene {spec.name} is loaded")
        self._last_tick = spec.loaded_tick
        self.spec = spec
        self._loaded_reported = False
        self._report_loaded()

    def _report_loaded(self) -> None:
        """Report the scene as loaded once all readers and writers are connected; called by a timer until then."""
        if self.spec is None or self._loaded_reported:
            return
        if any(subscription.get_publisher_count() == 0 for subscription in self.inputs):
            return
        if any(self.reader_count(name) < count for name, count in self._awaited_readers.items()):
            return
        self._loaded_reported = True
        self.report_finished(self.spec, self.spec.loaded_tick)

    def _expected_readers(self, spec: SceneSpec, names: list[str]) -> dict[str, int]:
        """Number of readers that each topic will have."""
        joined_names = {topic.name for topic in joint_inputs(spec).values()}
        displays = (each for each in recorded_displays(spec) if each.topic.name in self._recorded_topics)
        drawn = {each.sources[0] for each in displays}
        return {
            name: (self.recorded and (name in self._recorded_topics or name in drawn))
            + (name in self._annotated_periods)
            + (self._box_readers if name in joined_names else 0)
            + self._evaluated.count(name)
            for name in names
        }

    def is_needed(self, name: str, tick: int) -> bool:
        """Whether a tick's message on an advertised topic has a reader; an annotator is one at ticks with labels."""
        idle_annotators = int(tick % self._annotated_periods.get(name, 1) != 0)
        return self.reader_count(name) > idle_annotators

    def is_superfluous(self, names: Collection[str], tick: int) -> bool:
        """Whether a tick's messages are not needed: the tick has no labels, and only an annotator reads the topics."""
        has_labels = all(tick % self._annotated_periods.get(name, 1) == 0 for name in names)
        return not has_labels and not any(self.is_needed(name, tick) for name in names)

    def _on_actors(self, message: PointCloud2) -> None:
        if (actors := self.read(topics.ACTORS, actors_from_message, message)) is not None:
            self._join.open(stamp_of(message.header.stamp), actors)
            self._process_newest()

    def _on_signals(self, message: PointCloud2) -> None:
        if (signals := self.read(topics.SIGNALS, signals_from_message, message)) is not None:
            self._join.add(topics.SIGNALS, stamp_of(message.header.stamp), signals)
            self._process_newest()

    def _on_weather(self, message: String) -> None:
        if (weather := self.read(topics.WEATHER, weather_from_message, message)) is not None:
            self._join.add(topics.WEATHER, *weather)
            self._process_newest()

    def _process_newest(self) -> None:
        """Process the tick whose state is complete now. Each part comes in order, so in lockstep none is skipped."""
        if (spec := self.spec) is not None:
            for stamp_ns, actors, parts in self._join.release():
                signals, weather = parts[topics.SIGNALS], parts[topics.WEATHER]
                self._process(spec, WorldState(stamp_ns, spec.tick_of(stamp_ns), EGO_ID, actors, signals, weather))

    def _process(self, spec: SceneSpec, state: WorldState) -> None:
        skipped = range(self._last_tick + 1, state.tick)
        self.meter.count_late(sum(self.is_due(spec, tick) for tick in skipped))
        self._last_tick = state.tick
        if self.is_due(spec, state.tick):
            with self.meter.busy():
                self.process(spec, state)
        else:
            self.process(spec, state)
        if state.tick < 0:
            self.meter.discard_parts()
        self.finish(spec, state)


def _new_join() -> TickJoin[Table, Any]:
    """Joins the parts of the world's state by stamp."""
    return TickJoin(all_of(lambda _: (topics.SIGNALS, topics.WEATHER)), newest=True)


def _annotated_periods(view: AgentView) -> Iterator[tuple[str, int]]:
    """Topics of an agent that annotators may read, with the period at which they need them; some come twice."""
    for compressed in (False, True):
        for labels in (tuple(Label), (Label.BOXES,)):
            inputs = annotator_inputs(view, compressed_images=compressed, labels=labels)
            yield from ((topic.name, topic.period_ticks) for topic in inputs.values())
