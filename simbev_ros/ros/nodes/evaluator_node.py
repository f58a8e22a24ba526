"""The evaluator node: compares the answers of a perception stack with the ground truth while the scene runs.

Running figures are published on /evaluation; the figures of a scene are written to a file when it ends.
"""

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.duration import Duration
from rclpy.subscription import Subscription
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header, String

from simbev_ros.config.evaluation import Evaluation
from simbev_ros.evaluation.driving.figures import checked_figures
from simbev_ros.evaluation.joint_truth import boxes_in_reach
from simbev_ros.evaluation.live.answer_join import BOXES, LABELS, POSE, AnswerJoin, WaitLimits, pose_of
from simbev_ros.evaluation.live.answer_stamps import answered_tick
from simbev_ros.evaluation.live.live_evaluation import LiveEvaluation, LiveScene, live_figures
from simbev_ros.evaluation.options import options_of
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.files.whole_files import write_whole
from simbev_ros.foundation.geometry.transforms import inverse
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.recording.bag_files import disk_errors
from simbev_ros.ros.conventions.diagnostics import status
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.annotation_topics import annotation_topics
from simbev_ros.ros.msgs.images import labels_from_image
from simbev_ros.ros.msgs.joint_topics import JOINT_BOXES, joint_topics
from simbev_ros.ros.msgs.message_types import message_class
from simbev_ros.ros.msgs.qos import STEERING, qos_of, rclpy_qos
from simbev_ros.ros.msgs.sensor_topics import sensor_topics
from simbev_ros.ros.msgs.stamps import header, serialized_stamp_ns, stamp_of
from simbev_ros.ros.msgs.tables import rows_from_message, table_from_message
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.msgs.world import map_from_base_link
from simbev_ros.ros.nodes.answer_topics import Answer, AnswerTopics, received_s
from simbev_ros.ros.nodes.graph_node import GraphNode
from simbev_ros.ros.nodes.lockstep import LockstepWindow
from simbev_ros.ros.nodes.reports import read_report, subscribe_to_reports
from simbev_ros.scene.frames import ego_from_base_link
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.scene.agents import AgentView, agent_view, agent_views
from simbev_ros.schema.scene.spec import SceneSpec

_LIVE_GRACE_TICKS = 40
_LIVE_IDLE_S = 2.0
_DEPTH = 64
"""Queue depth of subscriptions: computing figures takes a while."""
_POLLS_TO_SETTLE = 5
"""This side of a connection is established a moment before the other side is."""
_SHARE_OF_TIME = 0.1
"""Maximum share of wall time that running figures may take."""
_LAST_FIGURES_PATIENCE_S = 1.0
_STATUS_FIGURES = ("mAP_iou", "mAP_distance", "SDS_iou", "mean_IoU")


class EvaluatorNode(GraphNode):
    """Evaluates one scene after the other. In lockstep the world waits for it, and so for the answers.

    A tick is reported as finished when its frame has been counted, the tick after the last when the file is written.
    """

    takes_message_info = True

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._evaluation = self.declare_section("evaluation", Evaluation)
        self._agent: str = self.declare_read_only(
            "agent", "", "Agent with the evaluated stack, if it is not the scene's first one"
        )
        files = [self.declare_read_only("figures", "", "File for the figures of all scenes up to now; empty: none")]
        files.append(
            self.declare_read_only("asked_figures", "", "A second such file, or a folder for one file per scene")
        )
        self._files = [Path(file) for file in files if file]
        self._input: str = self.declare_read_only("input_topic", "", "Topic that the stack answers to")
        self._patience_s: float = self.declare_read_only(
            "patience_s", 60.0, "Time that the first scene waits for the stack, s", minimum=0.0
        )
        others = self.declare_read_only(
            "outside_participants", [], "Nodes that need not sign their reports, in addition to the stack"
        )
        stack = self._evaluation.participants_of(self._agent)
        self._outside = frozenset((*stack, *others))
        idle_s = math.inf if stack else self._patience_s / 2
        self._patience = WaitLimits(_LIVE_GRACE_TICKS, _LIVE_IDLE_S) if self.live else WaitLimits(None, idle_s)
        self._options, self._scenes = options_of(self._evaluation), list[LiveScene]()
        self._numbers: set[int] = set()
        self._stack = LockstepWindow(stack, window_ticks=1, outside=stack)
        self._spec: SceneSpec | None = None
        self._views: dict[str, AgentView] = {}
        self._subscriptions_by_topic: dict[str, Subscription] = {}
        self._polls_connected, self._loaded_reported, self._scene_since_s = 0, False, 0.0
        self._next_figures_s = 0.0
        self._answers = AnswerTopics(
            self, self._evaluation.boxes_topic, self._evaluation.grids_topic, self._tick_of, self._on_answer, self.read
        )
        self._figures = self.create_publisher(DiagnosticArray, topics.EVALUATION, 10)
        self.follow_scenes(self._on_scene)
        self.create_subscription(String, topics.END, self._on_end, rclpy_qos(STEERING))
        if stack:
            subscribe_to_reports(self, self._on_ready, stack)
        self.create_wall_timer(0.05, self._report_loaded)
        self.create_wall_timer(0.1, self._advance)
        self.create_wall_timer(0.5, self._look_for_answers)

    def _on_scene(self, specification: str, _: bytes) -> None:
        """Start evaluating a scene; if the same scene starts again, its earlier frames do not count."""
        spec = SceneSpec.from_json(specification)
        self._evaluated = self._view_of(spec)
        answered, labels = self._answered_topic(spec), annotation_topics(self._evaluated)
        is_joint = self._options.truth == "joint"
        boxes = _joint_topic(spec) if is_joint else labels.boxes
        period = math.lcm(*(topic.period_ticks for topic in (answered, boxes, labels.bev_labels)))
        self._input_type = answered.type
        self._views = {view.agent: view for view in agent_views(spec)}
        poses = {name: POSE if name == self._evaluated.agent else pose_of(name) for name in self._views}
        others = [part for part in poses.values() if part != POSE]
        self._join = AnswerJoin(lambda tick: tick % period == 0, self._patience, others)
        self._live_evaluation = LiveEvaluation(self._evaluated, self._options)
        for name in self._answers.found:
            self._join.add_topic(name)
        for name, view in self._views.items():
            receive = self._truth(poses[name], partial(self._map_from_ego, name))
            self._subscribe(topics.odometry_topic(view), receive)
        read_boxes = self._joint_boxes if is_joint else partial(rows_from_message, dtype=BOX_DTYPE)
        self._subscribe(boxes, self._truth(BOXES, read_boxes))
        self._subscribe(labels.bev_labels, self._truth(LABELS, labels_from_image))
        self._subscribe(answered, self._on_input, raw=True)
        self._polls_connected, self._loaded_reported, self._scene_since_s = 0, False, time.monotonic()
        self._stack.start_scene(spec)
        self._scores = dict[int, Mapping[str, Any]]()
        for topic in topics.referee_topics(spec) if self._evaluated.index == 0 else ():
            if topic.name == topics.DRIVE_SCORE:
                self._subscribe(topic, self._on_score)
        self._spec = spec
        self._numbers.add(spec.number)

    def _view_of(self, spec: SceneSpec) -> AgentView:
        """The scene as the evaluated agent sees it."""
        try:
            return agent_view(spec, self._agent or None)
        except KeyError as error:
            raise InputError(f"agent: {error.args[0]}") from None

    def _answered_topic(self, spec: SceneSpec) -> Topic:
        """The input of the stack, which may be that of any agent."""
        known = {
            topic.name: topic
            for view in agent_views(spec)
            for form in (False, True)
            for topic in (*sensor_topics(view, compressed_images=form), topics.odometry_topic(view))
        }
        if self._input not in known:
            raise InputError(
                f"evaluation.answers_to: the scene has no topic {self._input}; allowed: {', '.join(known)}"
            )
        return known[self._input]

    def _subscribe(self, topic: Topic, callback: Callable[..., None], *, raw: bool = False) -> None:
        """Subscribe to a topic, once for all scenes that have it; odometry may be both ground truth and input."""
        key = f"{topic.name} raw" if raw else topic.name
        if key not in self._subscriptions_by_topic:
            qos = rclpy_qos(qos_of(topic, live=self.live))
            qos.depth = max(qos.depth, _DEPTH)
            self._subscriptions_by_topic[key] = self.create_subscription(
                message_class(topic.type), topic.name, callback, qos, raw=raw
            )

    def _truth(self, part: str, value_of: Callable[[Any], Any]) -> Callable[[Any], None]:
        def receive(message: Any) -> None:
            tick = self._tick(stamp_of(message.header.stamp))
            if tick is not None and (value := self.read(part, value_of, message)) is not None:
                self._join.add_truth(part, tick, value)
                self._advance()

        return receive

    def _map_from_ego(self, agent: str, odometry: Odometry) -> Float64Array:
        """(4, 4) pose of an agent's ego frame from the odometry of its base_link."""
        return map_from_base_link(odometry) @ inverse(ego_from_base_link(self._views[agent]))

    def _joint_boxes(self, message: PointCloud2) -> Table:
        """The joint boxes around the agent. Raises InputError if the table is of another scene."""
        return boxes_in_reach(table_from_message(message), self._evaluated)

    def _on_input(self, payload: bytes, info: Any) -> None:
        stamp_ns = self.read(self._input, serialized_stamp_ns, payload, self._input_type)
        tick = None if stamp_ns is None else self._tick(stamp_ns)
        if tick is not None:
            self._join.add_input(tick, received_s(info))

    def _on_score(self, message: String) -> None:
        """Keep a score of the scene's drive."""
        score = self.read(topics.DRIVE_SCORE, _score, message.data)
        if score is not None and (tick := self._tick(score["stamp_ns"])) is not None:
            self._scores[tick] = score
            self._advance()

    def _has_last_score(self, spec: SceneSpec) -> bool:
        """Whether the score at the end of a drive has arrived, if one is due; live, the referee may be late."""
        if self.live or topics.DRIVE_SCORE not in self._subscriptions_by_topic or spec.drive is None:
            return True
        return self._join.finished_tick in self._scores

    def _tick(self, stamp_ns: int) -> int | None:
        """Tick of a stamp of this scene; None for the lead-in and for other scenes."""
        tick = -1 if self._spec is None else self._spec.tick_of(stamp_ns)
        return tick if self._spec is not None and 0 <= tick < self._spec.ticks else None

    def _tick_of(self, stamp_ns: int) -> int | None:
        """Tick with exactly the stamp of an answer; None for the lead-in and earlier scenes."""
        return None if self._spec is None else answered_tick(stamp_ns, self._spec, self._numbers)

    def _on_answer(self, topic: str, tick: int, answer: Answer, at_s: float) -> None:
        try:
            self._join.add_answer(topic, tick, answer, at_s)
        except InputError as error:
            self.ignore(topic, error)
        self._advance()

    def ignore(self, topic: str, reason: Exception) -> None:
        """Count an answer that cannot be used also in the figures."""
        super().ignore(topic, reason)
        if topic in self._answers.found and self._spec is not None:
            self._join.counts.malformed += 1

    def _on_ready(self, message: Header) -> None:
        report = self.read(topics.READY, read_report, message, self.signer, self._outside)
        if report is None or not self._stack.record_report(report):
            return
        if (tick := self._stack.finished_by_all()) is not None:
            self._join.mark_stack_finished(tick)

    def _on_end(self, message: String) -> None:
        end = self.read_end(message)
        if end is not None and self._spec is not None and end.scene == self._spec.name:
            self._join.end_scene(end.tick)
            self._advance()

    def _look_for_answers(self) -> None:
        for name in self._answers.subscribe_to_new():
            if self._spec is not None:
                self._join.add_topic(name)
        for name in self._answers.refused.keys() - self._ignored:
            self.ignore(name, self._answers.refused[name])

    def _report_loaded(self) -> None:
        """Report the scene as loaded once everything, including the stack, is connected; called by a timer."""
        if self._spec is None or self._loaded_reported:
            return
        connected = all(each.get_publisher_count() for each in self._subscriptions_by_topic.values())
        self._polls_connected = self._polls_connected + 1 if connected and self._answers.are_connected else 0
        if self._polls_connected >= _POLLS_TO_SETTLE:
            self._loaded_reported = True
            self.report_finished(self._spec, -1)  # frames start at tick 0
        elif not self._answers.found and time.monotonic() > self._scene_since_s + self._patience_s:
            refused = "".join(f" ({reason})" for reason in self._answers.refused.values())
            raise InputError(
                f"no stack has connected within {self._patience_s:g} s: nothing publishes {self._answers.topic_names}"
                f"{refused}"
            )

    def _advance(self) -> None:
        """Count the frames that are ready, report finished ticks, and publish running figures from time to time."""
        spec = self._spec
        if spec is None:
            return
        before, now_s = self._join.finished_tick, time.monotonic()
        for frame in self._join.pop_ready_frames(now_s):
            with self.meter.busy():
                self._live_evaluation.add_frame(frame)
        if self._join.finished_tick > before:
            self.report_finished(spec, self._join.finished_tick)
        if self._join.is_over and self._has_last_score(spec):
            self._finish_scene(spec)
            self.report_finished(spec, self._join.finished_tick + 1)
        elif now_s >= self._next_figures_s:
            self._publish_figures(spec)
            took_s = time.monotonic() - now_s
            self._next_figures_s = now_s + max(1.0, took_s / _SHARE_OF_TIME)

    def _publish_figures(self, spec: SceneSpec) -> None:
        counts = self._join.counts
        figures = {**self._live_evaluation.running_figures(), **asdict(counts)}
        shown = [f"{name} {figures[name]:.3f}" for name in _STATUS_FIGURES if name in figures]
        level = DiagnosticStatus.WARN if counts.missed else DiagnosticStatus.OK
        words = ", ".join([f"{figures['frames']:g} frames, {counts.missed} missed", *shown])
        name = f"{self._agent} in {spec.name}" if self._agent else spec.name
        evaluated = status(self.node_name, f"evaluation of {name}", level, words, figures)
        stamp = header(spec.stamp_ns(max(self._join.finished_tick, 0)), "")
        self._figures.publish(DiagnosticArray(header=stamp, status=[evaluated]))

    def _finish_scene(self, spec: SceneSpec) -> None:
        """Write the figures of all scenes up to now, or those of this one (see the parameters)."""
        self._publish_figures(spec)
        scored = max((tick for tick in self._scores if tick <= self._join.finished_tick), default=-1)
        self._scenes.append(self._live_evaluation.finish(self._join.counts, self._scores.get(scored)))
        self._spec = None
        for path in self._files:
            if path.suffix == ".json":
                _write(path, self._figures_of(self._scenes))
            else:
                _write(path / f"{spec.name}.json", self._figures_of(self._scenes[-1:]))

    def _figures_of(self, scenes: Sequence[LiveScene]) -> dict[str, Any]:
        """Figures of scenes, with agent and kind of truth if that is not the first agent's own truth."""
        of_agent = {"agent": self._agent} if self._agent else {}
        truth = {"truth": self._options.truth} if self._options.truth != "own" else {}
        return {**of_agent, **truth, **live_figures(scenes, self._options)}

    def close(self) -> None:
        """Write the figures of an interrupted scene; wait until the last figures have arrived."""
        if self._spec is not None and self._join.finished_tick >= 0:
            self._finish_scene(self._spec)
        self._figures.wait_for_all_acked(Duration(seconds=_LAST_FIGURES_PATIENCE_S))


def _joint_topic(spec: SceneSpec) -> Topic:
    """The topic of the joint truth."""
    for topic in joint_topics(spec):
        if topic.name == JOINT_BOXES:
            return topic
    raise InputError(f"evaluation.truth: {spec.name} has one agent, and so no joint truth; it must be own")


def _score(text: str) -> Mapping[str, Any]:
    """A score of a drive. Raises ValueError, KeyError or TypeError if it is none."""
    figures = checked_figures(parse_json(text))
    return {**figures, "stamp_ns": int(figures["stamp_ns"])}


def _write(path: Path, figures: dict[str, Any]) -> None:
    with disk_errors(path.parent):
        write_whole(path, json.dumps(figures, indent=1).encode())
