"""Which cameras a camera node serves, and in which groups; agents with equal rigs do not mix."""

from typing import Any

import pytest
from made_up_scene import made_up_spec
from several_agents import car, roadside_unit, with_agents

from simbev_ros.ros.msgs.sensor_topics import label_info_topic
from simbev_ros.ros.nodes.camera_groups import camera_groups
from simbev_ros.schema.scene.agents import agent_view, agent_views
from simbev_ros.schema.scene.spec import SceneSpec

SENSORS: list[dict[str, Any]] = [
    {"type": "camera", "name": "slow", "rate_hz": 10, "modalities": ["rgb", "semantic"]},
    {"type": "camera", "name": "front"},
    {"type": "camera", "name": "back"},
    {"type": "lidar", "name": "lidar"},
]


def scene() -> SceneSpec:
    """Agents ``ego`` and ``car`` with equal rigs, and ``rsu``, whose camera is called ``cam``."""
    return with_agents(made_up_spec(SENSORS, number=2), car("car", 2, SENSORS), roadside_unit())


def served(names: list[str]) -> list[tuple[str, int, list[str]]]:
    """Agent, period and cameras of each group."""
    groups = camera_groups(agent_views(scene()), names)
    return [(each.view.agent, each.period_ticks, [mounted.camera.name for mounted in each.cameras]) for each in groups]


def test_groups_have_an_agents_cameras_of_one_period_the_shortest_first() -> None:
    assert served([]) == [
        ("ego", 1, ["front", "back"]),
        ("ego", 2, ["slow"]),
        ("car", 1, ["front", "back"]),
        ("car", 2, ["slow"]),
        ("rsu", 1, ["cam"]),
    ]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["back"], [("ego", 1, ["back"]), ("car", 1, ["back"])]),
        (["car/back"], [("car", 1, ["back"])]),
        (["rsu/cam", "ego/back", "ego/front"], [("ego", 1, ["front", "back"]), ("rsu", 1, ["cam"])]),
        (["rsu/back", "other/front"], []),
    ],
)
def test_cameras_are_named_with_or_without_their_agent(names: list[str], expected: list[Any]) -> None:
    assert served(names) == expected


def test_equal_cameras_of_two_agents_have_topics_and_frames_of_their_own() -> None:
    own, other = [each.cameras[0] for each in camera_groups(agent_views(scene()), ["slow"])]
    assert own.camera == other.camera and own != other
    assert (own.frame, other.frame) == ("ego/slow_optical", "car/slow_optical")
    assert own.info.name == "/ego/slow/camera_info" and other.info.name == "/car/slow/camera_info"
    assert other.topics["rgb"].raw.name == "/car/slow/rgb/image_raw"
    assert other.label_info == label_info_topic(agent_view(scene(), "car"), other.camera)


def test_noise_differs_between_agents_and_drops_of_the_first_one_depend_on_the_camera_alone() -> None:
    first, second, unit = camera_groups(agent_views(scene()), ["front", "cam"])
    assert len({first.noise_seed, second.noise_seed, unit.noise_seed}) == 3
    assert first.noise_seed == scene().seed
    assert (first.lens_seed, second.lens_seed, unit.lens_seed) == (0, second.noise_seed, unit.noise_seed)


@pytest.mark.parametrize(
    ("settings", "expected"), [({}, None), ({"imager": {}}, None), ({"preset": "acA1600-60gc"}, 90)]
)
def test_products_compress_with_a_quality_of_their_own(settings: dict[str, Any], expected: int | None) -> None:
    spec = made_up_spec([{"type": "camera", "name": "front", **settings}], number=1)
    [group] = camera_groups([agent_view(spec, "ego")], [])
    assert group.cameras[0].jpeg_quality == expected
