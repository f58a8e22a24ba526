"""A camera node that serves several agents: each agent's images are rendered from its own view of the world."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from fake_cameras import play, set_readers, started_camera_node
from made_up_scene import made_up_spec
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo, Image
from several_agents import car, roadside_unit, with_agents

from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.schema.scene.spec import SceneSpec

CAMERA = {"type": "camera", "name": "cam", "width_px": 16, "height_px": 16, "modalities": ["rgb", "semantic", "flow"]}
SENSORS: list[dict[str, Any]] = [CAMERA, {**CAMERA, "name": "slow", "rate_hz": 10}]
AGENTS = ("ego", "car", "rsu")
ONE_EACH = [f"/{agent}/cam/rgb/image_raw" for agent in AGENTS]


@pytest.fixture(scope="module")
def spec() -> SceneSpec:
    """Two cars and a roadside unit with equal rigs."""
    return with_agents(made_up_spec(SENSORS, number=2), car("car", 2, SENSORS), roadside_unit("rsu", SENSORS))


@pytest.fixture
def node(spec: SceneSpec, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    with started_camera_node(spec, monkeypatch) as made:
        yield made


def test_images_of_equal_rigs_do_not_mix(node: Any, spec: SceneSpec, monkeypatch: pytest.MonkeyPatch) -> None:
    set_readers(node, monkeypatch, *ONE_EACH)
    play(node, spec, [0])
    images = {name: message for name, message in node.sent if isinstance(message, Image)}
    assert list(images) == ONE_EACH
    for agent, name in zip(AGENTS, ONE_EACH, strict=True):
        assert images[name].header.frame_id == f"{agent}/cam_optical"
        assert np.unique(images[name].data).tolist() == [agent_view(spec, agent).ego_id % 251]


def test_each_agents_camera_info_is_published_once(node: Any, spec: SceneSpec, monkeypatch: pytest.MonkeyPatch) -> None:
    set_readers(node, monkeypatch)
    play(node, spec, [0, 1])
    shared = [(name, message) for name, message in node.sent if name.endswith("cam/camera_info")]
    assert [name for name, _ in shared] == [f"/{agent}/cam/camera_info" for agent in AGENTS] * 2
    frames = [deserialize_message(message, CameraInfo).header.frame_id for _, message in shared[:3]]
    assert frames == [f"{agent}/cam_optical" for agent in AGENTS]


def test_flow_refers_to_the_agents_own_previous_frame(
    node: Any, spec: SceneSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_readers(node, monkeypatch, *(f"/{agent}/{name}/flow/image_raw" for agent in AGENTS for name in ("cam", "slow")))
    renderer = play(node, spec, range(3))
    frames = [frame for _, frame in renderer.calls if frame.previous is not None]
    ids = [agent_view(spec, agent).ego_id for agent in AGENTS]
    found = [(frame.world.ego_id, frame.world.tick, frame.previous.tick) for frame in frames if frame.previous]
    assert found == [(id, 1, 0) for id in ids] + [(id, 2, before) for id in ids for before in (1, 0)]
    assert all(frame.previous is not None and frame.previous.ego_id == frame.world.ego_id for frame in frames)


def test_agents_are_rendered_in_turns_as_egos_of_the_state(
    node: Any, spec: SceneSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_readers(node, monkeypatch, *ONE_EACH)
    renderer = play(node, spec, [0])
    assert renderer.agents == 3
    own, other, unit = (frame.world for _, frame in renderer.calls)
    assert (own.ego_id, other.ego_id) == (1, 3) and (own.station, other.station) == (None, None)
    assert unit.station is not None and unit.ego["x"] == 12.0
    assert unit.ego_ids == {agent_view(spec, "rsu").ego_id}, "it has no body to hide"
    seeds = [(view.noise_seed, view.lens_seed) for views, _ in renderer.calls for view in views]
    assert len({noise for noise, _ in seeds}) == len({lens for _, lens in seeds}) == 3


def test_topics_of_all_agents_are_advertised_and_can_be_recorded(node: Any) -> None:
    names = dict(node.get_topic_names_and_types())
    for agent in AGENTS:
        assert f"/{agent}/slow/flow/image_raw/compressed" in node.recorded_topics
        assert names[f"/{agent}/slow/semantic/color"] == ["sensor_msgs/msg/Image"]


def test_only_the_named_cameras_are_served(spec: SceneSpec, monkeypatch: pytest.MonkeyPatch) -> None:
    with started_camera_node(spec, monkeypatch, "-p", "sensors:=['car/slow']") as node:
        set_readers(node, monkeypatch, "/car/slow/rgb/image_raw", *ONE_EACH)
        assert not node.is_due(spec, 1) and node.is_due(spec, 2)
        renderer = play(node, spec, range(3))
        assert renderer.agents == 1
        assert [(frame.world.ego_id, frame.world.tick) for _, frame in renderer.calls] == [(3, 0), (3, 2)]


def test_a_scene_with_fewer_agents_may_follow(node: Any, spec: SceneSpec, monkeypatch: pytest.MonkeyPatch) -> None:
    alone = made_up_spec(SENSORS, number=3)
    set_readers(node, monkeypatch, *ONE_EACH)
    play(node, spec, [0])
    node.start_scene(alone)
    renderer = play(node, alone, [0])
    assert renderer.agents == 1
    assert [frame.world.ego_id for _, frame in renderer.calls[3:]] == [1]
    assert renderer.calls[3][1].previous is None
