"""What other agents have sent to a frame's agent: the frames that the newest messages which have arrived are about."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_scene import record_made_up
from several_agents import made_up_agents

from simbev_ros.dataset import Scene, open_dataset
from simbev_ros.dataset.messages import newest_messages
from simbev_ros.foundation.types import Table
from simbev_ros.schema.scene.agents import agent_views
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.v2x import V2X_DTYPE

PLAIN = made_up_agents()
IDS = {view.agent: view.ego_id for view in agent_views(PLAIN)}


def spec_with(**settings: Any) -> SceneSpec:
    v2x = {"range_m": 100.0, "agents": ["ego", "car", "rsu"]} | settings
    return SceneSpec.model_validate(PLAIN.model_dump(mode="json") | {"v2x": v2x})


def messages(**sent: int) -> Table:
    """A pose and a box of each sender, sent at these ticks."""
    rows = np.zeros(2 * len(sent), V2X_DTYPE)
    rows["sender"] = np.repeat([IDS[name] for name in sent], 2)
    rows["id"], rows["tick"] = np.tile([0, 9], len(sent)), np.repeat(list(sent.values()), 2)
    return rows


def record(path: Path, arrived: Mapping[str, list[Table]], **settings: Any) -> Scene:
    spec = spec_with(**settings)
    record_made_up(path / spec.name, spec, tables={f"/{name}/v2x": tables for name, tables in arrived.items()})
    return open_dataset(path / spec.name).scenes[0]


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    """Both others send to the ego at each tick; they arrive after one tick, the unit's first one never."""
    to_ego = [messages(), messages(car=0), *(messages(car=k - 1, rsu=k - 1) for k in range(2, PLAIN.ticks))]
    return record(tmp_path, {"ego": to_ego, "car": [messages(ego=k) for k in range(PLAIN.ticks)]})


def test_messages_that_arrive_are_the_agents_own_key(scene: Scene) -> None:
    assert scene[1]["v2x"].tobytes() == messages(car=0).tobytes()
    assert scene.of_agent("car")[1]["v2x"].tobytes() == scene[1]["car/v2x"].tobytes() == messages(ego=1).tobytes()
    assert scene[0]["v2x"].shape == (0,)


def test_received_frames_are_those_that_the_newest_messages_tell_about(scene: Scene) -> None:
    assert [{name: frame.tick for name, frame in each.received.items()} for each in scene[:3]] == [
        {},
        {"car": 0},
        {"car": 1, "rsu": 1},
    ]
    received = scene[2].received["rsu"]
    assert (received.scene.agent, received.stamp_ns) == ("rsu", scene[1].stamp_ns)
    assert received["boxes"].tobytes() == scene.of_agent("rsu")[1]["boxes"].tobytes()
    assert {name: frame.tick for name, frame in scene.of_agent("car")[2].received.items()} == {"ego": 2}


def newest(arrived: Mapping[int, Table], tick: int, scene: Scene) -> dict[str, int]:
    return newest_messages(scene.spec, scene.agent, tick, arrived.get)


def test_a_message_that_was_overtaken_is_not_the_newest_one(scene: Scene) -> None:
    arrived = {5: messages(car=2), 4: messages(car=3, rsu=0), 3: messages(rsu=1)}
    assert newest(arrived, 5, scene) == {"car": 3, "rsu": 1}
    assert newest(arrived, 4, scene) == {"car": 3, "rsu": 1}
    assert newest(arrived, 3, scene) == {"rsu": 1}


def test_messages_are_forgotten_after_a_second_or_a_period(scene: Scene, tmp_path: Path) -> None:
    arrived = {10: messages(car=9)}
    assert [newest(arrived, tick, scene) for tick in (10, 29, 30)] == [{"car": 9}, {"car": 9}, {}]
    slow = record(tmp_path / "slow", {"ego": [messages()] * PLAIN.ticks}, rate_hz=0.5)
    assert [newest(arrived, tick, slow) for tick in (10, 49, 50)] == [{"car": 9}, {"car": 9}, {}]


def test_no_more_ticks_are_read_than_needed(scene: Scene) -> None:
    read = list[int]()

    def arrived_at(tick: int) -> Table:
        read.append(tick)
        return messages(car=tick - 2, rsu=tick - 2)

    assert newest_messages(scene.spec, scene.agent, 50, arrived_at) == {"car": 48, "rsu": 48}
    assert read == [50, 49]


def test_a_scene_without_messages_to_the_agent_says_so(scene: Scene) -> None:
    with pytest.raises(KeyError, match="scene Blocks-0002 has no messages to rsu"):
        _ = scene.of_agent("rsu")[1].received
