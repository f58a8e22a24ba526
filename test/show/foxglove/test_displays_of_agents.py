"""Displays are made of a bag, and transforms of a graph, for every agent of a scene."""

from pathlib import Path

import numpy as np
import pytest
from made_up_scene import SENSORS, MadeUp, boxes, made_up_spec, record_made_up
from rclpy.serialization import serialize_message
from ros_messages import TYPES
from several_agents import made_up_agents

from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.recording.reader import RawMessage, SceneBag
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.world import agent_odometry
from simbev_ros.schema.scene.agents import agent_views
from simbev_ros.schema.scene.state import ACTOR_DTYPE
from simbev_ros.show.foxglove.derived import derivations
from simbev_ros.show.foxglove.relayed_topics import RelayedTopic, _transform_topics

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


def test_transforms_of_a_graph_are_made_of_the_odometry_of_every_agent() -> None:
    names = ["/car/odom", "/ego/odom", "/rsu/odom", "/ego/wheel/odometry"]
    relayed = {
        name: RelayedTopic(name, "nav_msgs/msg/Odometry", (name,), "nav_msgs/msg/Odometry", False) for name in names
    }
    (topic,) = _transform_topics(relayed)
    assert (topic.name, topic.sources) == (topics.TF, ("/car/odom", "/ego/odom", "/rsu/odom"))
    assert topic.make is not None
    actors = np.zeros(4, ACTOR_DTYPE)
    actors["id"], actors["x"] = 1 + np.arange(4), 10.0 * np.arange(4)
    for view, x_m in zip(agent_views(SPEC), (0.0, 20.0, 12.0), strict=True):
        payload = bytes(serialize_message(agent_odometry(view, actors, SPEC.start_ns)))
        (made,) = TYPES.deserialize_cdr(topic.make(payload), "tf2_msgs/msg/TFMessage").transforms
        assert (made.header.frame_id, made.child_frame_id) == ("map", f"{view.rig.agent}/base_link")
        assert made.transform.translation.x == x_m
