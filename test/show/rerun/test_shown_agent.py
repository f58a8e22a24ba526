"""The viewer of a running graph shows the chosen agent, and ends if a scene does not have it."""

from collections.abc import Iterator

import numpy as np
import pytest
import rclpy
from made_up_scene import SENSORS, boxes, made_up_spec
from rclpy.serialization import serialize_message
from ros_messages import point_cloud
from several_agents import made_up_agents
from std_msgs.msg import String

from simbev_ros.foundation.errors import InputError
from simbev_ros.ros.graph.domain import DomainLock
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.show.rerun.live.drawn_topics import drawn_topics
from simbev_ros.show.rerun.live.graph_reader import GraphReader
from simbev_ros.show.rerun.live.live_frame import LiveFrame, LiveScene, Payloads
from simbev_ros.show.rerun.live.newest_frame import NewestFrame

SPEC = made_up_agents()
BOXES = boxes(np.random.default_rng(1), 4)


class Silent:
    """An observer of which nothing is wanted."""

    def graph_noticed(self, is_there: bool) -> None: ...
    def scene_shown(self, name: str) -> None: ...
    def messages_ignored(self, reason: str) -> None: ...


@pytest.fixture
def domain() -> Iterator[None]:
    """A ROS domain in which nobody else is."""
    with DomainLock() as lock:
        rclpy.init(domain_id=lock.domain)
        yield
        rclpy.try_shutdown()


def reader_of(agent: str | None) -> GraphReader:
    """A reader that has received the scene."""
    reader = GraphReader(NewestFrame(), 5.0, layers=False, observer=Silent(), agent=agent)
    reader._on_scene(bytes(serialize_message(String(data=SPEC.model_dump_json()))))
    return reader


def test_topics_of_the_shown_agent_alone_are_read() -> None:
    names = [topic.name for topic in drawn_topics(agent_view(SPEC, "car"), lambda forms: forms.raw, layers=True)]
    assert {"/car/odom", "/car/boxes", "/car/lidar/points", "/world/events"} <= set(names)
    assert not [name for name in names if not name.startswith(("/car/", "/world/"))]


def test_keys_of_a_frame_are_those_of_the_shown_agent() -> None:
    payload = point_cloud(SPEC.stamp_ns(0), BOXES)
    names = "/car/boxes", "/prediction/boxes"
    payloads = [Payloads(Topic(name, "sensor_msgs/msg/PointCloud2"), [payload]) for name in names]
    frame = LiveFrame(LiveScene(agent_view(SPEC, "car"), 0), 0, payloads, None)
    assert list(frame) == ["boxes", "ego/prediction/boxes"]
    assert frame["boxes"].tobytes() == BOXES.tobytes()


@pytest.mark.usefixtures("domain")
@pytest.mark.parametrize(("agent", "shown"), [(None, "ego"), ("ego", "ego"), ("rsu", "rsu")])
def test_a_scene_is_shown_as_the_agent_sees_it(agent: str | None, shown: str) -> None:
    reader = reader_of(agent)
    reader.raise_failure()
    assert reader._scene is not None and reader._scene.view.agent == shown
    reader.destroy_node()


@pytest.mark.usefixtures("domain")
def test_a_scene_without_the_agent_ends_the_viewer_with_the_names_of_those_that_there_are() -> None:
    reader = reader_of("bus")
    with pytest.raises(InputError, match="agent: Blocks-0002: no agent 'bus'; there are: ego, car, rsu"):
        reader.raise_failure()
    reader.destroy_node()


def test_the_sheet_of_a_scene_with_several_agents_names_the_shown_one() -> None:
    pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")
    from simbev_ros.show.rerun.scene_sheet import scene_sheet

    assert "| agent | rsu, one of 3 |" in scene_sheet(agent_view(SPEC, "rsu"))
    assert "| agent |" not in scene_sheet(agent_view(made_up_spec(SENSORS)))
