"""Messages of a running graph become frames of one tick each, at most so many per second."""

from collections.abc import Iterable

import pytest
from made_up_scene import SENSORS, made_up_spec

from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.show.rerun.live.frame_join import MAX_LAG_TICKS, FrameJoin
from simbev_ros.show.rerun.live.live_frame import LiveFrame, LiveScene
from simbev_ros.show.rerun.live.newest_frame import NewestFrame
from simbev_ros.show.rerun.live.tick_rate import TickRate

SPEC = made_up_spec(SENSORS, ticks=100)
SCENE = LiveScene(agent_view(SPEC), 0)
ODOM = Topic("/ego/odom", "nav_msgs/msg/Odometry")
IMAGE = Topic("/ego/cam_front/rgb/image_raw", "sensor_msgs/msg/Image", period_ticks=2, sensor=True)
BOXES = Topic("/ego/cam_front/boxes", "sensor_msgs/msg/PointCloud2", period_ticks=2)
IMU = Topic("/ego/imu/data", "sensor_msgs/msg/Imu", sensor=True, messages_per_tick=2)
EVENTS = Topic("/world/events", "std_msgs/msg/String", sporadic=True)


class Graph:
    """Sends messages to a join; each says its topic's name and its tick."""

    def __init__(self, topics: Iterable[Topic], interval_s: float = 0.0) -> None:
        self.join, self.now_s = FrameJoin(SCENE, topics, interval_s), 0.0

    def send(self, topic: Topic, tick: float) -> LiveFrame | None:
        stamp_ns = SPEC.start_ns + round(tick * SPEC.tick_ns)
        return self.join.add(topic.name, stamp_ns, f"{topic.name} {tick:g}".encode(), self.now_s, TickRate())


def content(frame: LiveFrame | None) -> dict[str, list[str]]:
    """Ticks of the messages of a frame, by key."""
    assert frame is not None
    return {key: [each.decode().split()[1] for each in payloads.messages] for key, payloads in frame._payloads.items()}


def test_a_frame_has_one_tick_although_its_topics_are_ticks_apart() -> None:
    graph = Graph([ODOM, IMAGE, BOXES])
    sent = [graph.send(topic, tick) for topic, tick in ((ODOM, 0), (IMAGE, 0), (ODOM, 1), (ODOM, 2), (IMAGE, 2))]
    assert sent == [None] * 5
    first = graph.send(BOXES, 0)  # completes ticks 0 and 1, of which the newer one is drawn
    assert first is not None and first.tick == 1
    assert content(graph.send(BOXES, 2)) == {"odom": ["2"], "cam_front/rgb": ["2"], "cam_front/boxes": ["2"]}


def test_a_slow_sensors_sample_is_drawn_once() -> None:
    graph = Graph([ODOM, IMAGE])
    assert graph.send(ODOM, 0) is None
    assert content(graph.send(IMAGE, 0)) == {"odom": ["0"], "cam_front/rgb": ["0"]}
    assert content(graph.send(ODOM, 1)) == {"odom": ["1"]}


def test_a_lost_message_delays_its_frame_until_the_topics_next_one() -> None:
    graph = Graph([ODOM, IMAGE])
    for topic, tick in ((ODOM, 0), (IMAGE, 0), (ODOM, 1), (ODOM, 2), (ODOM, 3)):
        graph.send(topic, tick)
    assert content(graph.send(IMAGE, 4)) == {"odom": ["3"]}


def test_a_topic_that_has_fallen_silent_is_not_waited_for() -> None:
    graph = Graph([ODOM, IMAGE])
    sent = [graph.send(ODOM, tick) for tick in range(MAX_LAG_TICKS + 2)]
    assert sent[0] is None and sent[-1] is not None
    graph = Graph([ODOM, IMAGE])
    graph.join.await_only([ODOM.name])
    assert content(graph.send(ODOM, 0)) == {"odom": ["0"]}


def test_a_fast_sensor_contributes_all_its_rows_of_a_tick() -> None:
    graph = Graph([ODOM, IMU])
    for topic, tick in ((ODOM, 0), (IMU, 0), (ODOM, 1), (IMU, 0.5)):
        last = graph.send(topic, tick)
    assert last is None
    assert content(graph.send(IMU, 1)) == {"odom": ["1"], "imu/data": ["0.5", "1"]}


def test_ticks_that_come_too_fast_are_dropped() -> None:
    graph = Graph([ODOM], interval_s=0.2)
    shown = []
    for tick in range(20):
        if (frame := graph.send(ODOM, tick)) is not None:
            shown.append(frame.tick)
        graph.now_s += 0.05 + 1e-9
    assert shown == [0, 4, 8, 12, 16]


def test_texts_of_all_ticks_since_the_last_frame_are_drawn() -> None:
    graph = Graph([ODOM, EVENTS])
    for text in (b"first", b"second"):
        graph.join.add_text(EVENTS, text)
    frame = graph.send(ODOM, 0)
    assert frame is not None and list(frame._payloads["world/events"].messages) == [b"first", b"second"]
    assert "world/events" not in content(graph.send(ODOM, 1))


@pytest.mark.parametrize("tick", [-1, 100, 10**9])
def test_messages_before_and_after_the_scene_are_ignored(tick: int) -> None:
    graph = Graph([ODOM])
    assert graph.send(ODOM, tick) is None
    assert graph.send(ODOM, 0) is not None


def test_messages_that_are_not_drawn_are_not_kept() -> None:
    graph = Graph([ODOM, IMAGE], interval_s=1e9)
    graph.send(ODOM, 0)
    for tick in range(0, 100, 2):
        graph.send(IMAGE, tick)
    assert len(graph.join._join._messages[IMAGE.name]) == 1


def test_a_frame_that_is_not_taken_is_replaced_by_the_next() -> None:
    frames = NewestFrame()
    for tick in range(3):
        frames.put(LiveFrame(SCENE, tick, [], None))
    taken = frames.take(0.0)
    assert taken is not None and taken.tick == 2
    assert frames.take(0.0) is None


def test_the_rate_follows_the_last_seconds() -> None:
    rate = TickRate()
    assert rate.ticks_per_s is None
    for tick in range(100):
        rate.add(tick, 0.1 * tick)
    for tick in range(100, 200):
        rate.add(tick, 10.0 + 0.5 * (tick - 100))
    assert rate.ticks_per_s == pytest.approx(2.0)
