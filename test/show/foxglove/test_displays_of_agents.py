"""Displays are made of a bag, and transforms of a graph, for every agent of a scene."""

from pathlib import Path

import numpy as np
import pytest
from made_up_scene import SENSORS, MadeUp, boxes, made_up_spec, record_made_up
from rclpy.serialization import serialize_message
from ros_messages import TYPES, point_cloud
from scene_edits import with_ego
from several_agents import made_up_agents
from std_msgs.msg import String

from simbev_ros.config.frames import Frames
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.recording.reader import RawMessage, SceneBag
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.derived_messages import message_makers
from simbev_ros.schema.scene.state import ACTOR_DTYPE
from simbev_ros.show.foxglove.derived import derivations
from simbev_ros.show.foxglove.relayed_topics import GraphTransforms, RelayedTopic, transform_topics

SPEC = made_up_agents()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, MadeUp]:
    """A bag with the agents ego, car and rsu, and what is in it."""
    path = tmp_path_factory.mktemp("agents") / SPEC.name
    return path, record_made_up(path, SPEC, tables={"/world/boxes": boxes(np.random.default_rng(7), 5)})


def last(bag: SceneBag, topic: str) -> RawMessage:
    return [*bag.messages([topic])][-1]


def test_every_agent_has_the_displays_of_an_only_one(made: tuple[Path, MadeUp], tmp_path: Path) -> None:
    record_made_up(tmp_path / SPEC.name, made_up_spec(SENSORS, number=2))
    with SceneBag(tmp_path / SPEC.name) as alone, SceneBag(made[0]) as bag:
        names, found = [*derivations(alone)], derivations(bag)
    assert [name for name in found if name in names] == names
    own = {name.removeprefix("/ego/") for name in names if name.startswith("/ego/")}
    assert {name.removeprefix("/car/") for name in found if name.startswith("/car/")} == own
    assert {"/rsu/path", "/rsu/boxes/markers", "/rsu/bev/color", "/rsu/cam/depth/color"} <= found.keys()


@pytest.mark.parametrize("agent", ["ego", "car", "rsu"])
def test_displays_are_made_of_the_agents_own_messages(made: tuple[Path, MadeUp], agent: str) -> None:
    values = (made[1].ticks if agent == "ego" else made[1].others[agent])[-1]
    with SceneBag(made[0]) as bag:
        found = {name: derived for name, derived in derivations(bag).items() if name.startswith(f"/{agent}/")}
        sent = {name: each.make([last(bag, source) for source in each.sources]) for name, each in found.items()}
        types = {name: each.type_name for name, each in found.items()}
    path, grid, points = (
        TYPES.deserialize_cdr(sent[name], types[name])
        for name in (f"/{agent}/path", f"/{agent}/bev/car/grid", f"/{agent}/boxes/points")
    )
    position = path.poses[-1].pose.position
    np.testing.assert_allclose([position.x, position.y, position.z], values["odom"][0])
    covered = values["bev/labels"] >> BEV_CLASSES.index("car") & 1
    assert (grid.data > 0).sum() == covered.sum()
    assert grid.header.frame_id == f"{agent}/base_link"
    assert points.width == len(values["boxes"])


@pytest.mark.parametrize("odom", [False, True])
def test_transforms_of_a_graph_are_those_that_its_recorder_makes(odom: bool) -> None:
    spec = with_ego(SPEC, frames=Frames(odom=odom))
    actors = np.zeros(4, ACTOR_DTYPE)
    actors["id"], actors["x"] = 1 + np.arange(4), 10.0 * np.arange(4)
    payload = point_cloud(spec.start_ns, actors)
    cloud, text = "sensor_msgs/msg/PointCloud2", "std_msgs/msg/String"
    relayed = {
        topics.ACTORS: RelayedTopic(topics.ACTORS, cloud, (topics.ACTORS,), cloud, False),
        topics.SCENE: RelayedTopic(topics.SCENE, text, (topics.SCENE,), text, True),
    }
    moving, static = transform_topics(relayed, GraphTransforms())
    assert moving.make is not None and static.make is not None
    assert (moving.name, moving.sources, moving.is_latched) == (topics.TF, (topics.ACTORS,), False)
    assert (static.name, static.sources, static.is_latched) == (topics.TF_STATIC, (topics.SCENE,), True)
    assert moving.make(payload) is None, "no scene has been announced yet"
    static.make(bytes(serialize_message(String(data=spec.model_dump_json()))))
    recorder = message_makers(spec, (), {topics.TF})[topics.ACTORS][topics.TF]
    made = moving.make(payload)
    assert made == recorder(payload, spec.start_ns)
    frames = [each.child_frame_id for each in TYPES.deserialize_cdr(made, "tf2_msgs/msg/TFMessage").transforms]
    assert frames == [*(["ego/odom"] if odom else []), "ego/base_link", "car/base_link", "rsu/base_link"]
