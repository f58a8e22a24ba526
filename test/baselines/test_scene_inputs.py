"""What a baseline expects of a scene follows from its rig: topics, ticks, projections; unsuitable rigs are refused."""

from typing import Any

import numpy as np
import pytest
from ego_frames import with_frames
from made_up_scene import made_up_spec
from several_agents import car, with_agents

from simbev_ros.baselines.modality import Modality
from simbev_ros.baselines.node.scene_inputs import SceneInputs, inputs_of_scene, stacked_projections
from simbev_ros.foundation.errors import InputError
from simbev_ros.schema.scene.spec import SceneSpec

FRONT = {"type": "camera", "name": "front", "pose": {"x_m": 0.6, "z_m": 1.6}, "width_px": 1600, "height_px": 900}
LEFT = {**FRONT, "name": "left", "pose": {"y_m": 0.5, "z_m": 1.5, "yaw_deg": 90}, "rate_hz": 5}
FISHEYE = {"distortion_model": "equidistant", "horizontal_fov_deg": 190}
LABELS = {**FRONT, "name": "labels", "modalities": ["semantic"]}
LIDAR = {"type": "lidar", "name": "lidar", "pose": {"z_m": 1.8}, "rate_hz": 10}
ROOF = {**LIDAR, "name": "roof", "pose": {"z_m": 2.2, "yaw_deg": 90}, "rate_hz": None}
SIZE_PX = (704, 256)


def spec_of(*sensors: dict[str, Any]) -> SceneSpec:
    return made_up_spec(list(sensors), number=2, split="train", ticks=10)


def inputs_of(
    spec: SceneSpec, modality: Modality = Modality.FUSED, lidar_topic: str = "", cameras: int = 6
) -> SceneInputs:
    return inputs_of_scene(spec.model_dump_json(), modality, lidar_topic, cameras, SIZE_PX)


def test_a_model_gets_the_topics_of_what_it_sees() -> None:
    spec = spec_of(LABELS, FRONT, LEFT, LIDAR, ROOF)
    fused, lidar, camera = (inputs_of(spec, modality) for modality in (Modality.FUSED, Modality.LIDAR, Modality.CAMERA))
    assert fused.lidar is not None and lidar.lidar is not None
    assert fused.lidar.topic == lidar.lidar.topic == "/ego/lidar/points"
    assert camera.lidar is None and lidar.cameras == {}
    assert [*fused.cameras] == [*camera.cameras] == ["front", "left"]
    assert fused.cameras["left"].compressed_topic == "/ego/left/rgb/image_raw/compressed"
    assert fused.cameras["left"].raw_topic == "/ego/left/rgb/image_raw"


def test_facts_equal_those_of_the_scene_spec() -> None:
    spec = with_frames(spec_of(LIDAR), base_link="rear_axle")
    inputs = inputs_of(spec, Modality.LIDAR)
    assert (inputs.name, inputs.start_ns, inputs.tick_ns) == (spec.name, spec.start_ns, spec.tick_ns)
    assert inputs.ego_frame == "ego/footprint"
    assert inputs.base_link_from_ego[:3, 3] == pytest.approx([1.4, 0, 0])
    bev = spec.agents[0].annotation.bev
    assert bev is not None and inputs.grid is not None
    assert (inputs.grid.rows, inputs.grid.columns, inputs.grid.cell_m) == (bev.rows, bev.columns, bev.cell_m)


def test_another_lidar_can_be_chosen_by_its_topic() -> None:
    lidar = inputs_of(spec_of(LIDAR, ROOF), Modality.LIDAR, "/ego/roof/points").lidar
    assert lidar is not None
    assert lidar.period_ticks == 1
    assert lidar.ego_from_lidar[:3, :3] @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])


def test_there_is_a_frame_where_all_inputs_are_due() -> None:
    spec = spec_of(FRONT, LEFT, LIDAR)
    inputs, names = inputs_of(spec), {"front": 1, "left": 4, "lidar": 2}
    for tick in range(-2, 9):
        due = {topic.split("/")[2] for topic in inputs.due(spec.stamp_ns(tick))}
        assert due == {name for name, period in names.items() if tick >= 0 and tick % period == 0}
        assert inputs.is_frame(spec.stamp_ns(tick)) == (tick in (0, 4, 8))


def test_cameras_project_points_of_the_ego_frame_to_the_models_pixels() -> None:
    front, left = stacked_projections([*inputs_of(spec_of(FRONT, LEFT, LIDAR)).cameras.values()])
    u, v, depth_m = front @ [10.6, 1.0, 1.6, 1.0]
    assert depth_m == pytest.approx(10.0)
    assert (u / depth_m, v / depth_m) == pytest.approx((351.5 - 41.95, 58.0), abs=0.6)
    u, v, depth_m = left @ [1.0, 10.5, 0.5, 1.0]  # to the right of its axis, and below
    assert depth_m == pytest.approx(10.0)
    assert (u / depth_m, v / depth_m) == pytest.approx((351.5 + 41.95, 58.0 + 41.95), abs=0.6)


def test_cameras_that_are_more_than_the_model_takes_are_named() -> None:
    inputs = inputs_of(spec_of(FRONT, LEFT, LIDAR), cameras=1)
    assert [*inputs.cameras] == ["front"]
    assert inputs.unseen_cameras == ("left",)


@pytest.mark.parametrize(
    ("sensors", "lidar_topic", "message"),
    [
        ([FRONT], "", "the rig has no lidar with points"),
        ([FRONT, LIDAR], "/ego/top/points", "no lidar of .* publishes /ego/top/points; allowed: /ego/lidar/points"),
        ([LABELS, LIDAR], "", "the rig has no camera with rgb images"),
        ([{**FRONT, "distortion": [-0.1, 0, 0, 0, 0]}, LIDAR], "", "camera front: has a distorting lens"),
        ([{**FRONT, **FISHEYE}, LIDAR], "", "camera front: has a distorting lens"),
    ],
)
def test_an_unsuitable_rig_is_refused(sensors: list[dict[str, Any]], lidar_topic: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        inputs_of(spec_of(*sensors), lidar_topic=lidar_topic)


def test_projections_of_no_cameras_are_an_empty_array() -> None:
    assert stacked_projections([]).shape == (0, 3, 4) and stacked_projections([]).dtype == np.float64


def test_a_model_may_see_what_another_agent_sees() -> None:
    spec = with_agents(spec_of(LIDAR, FRONT), car("car", 2, [ROOF, LEFT]))
    inputs = inputs_of_scene(spec.model_dump_json(), Modality.FUSED, cameras=6, size_px=SIZE_PX, agent="car")
    assert inputs.lidar is not None and inputs.lidar.topic == "/car/roof/points"
    assert inputs.cameras["left"].raw_topic == "/car/left/rgb/image_raw"
    assert (inputs.odometry_topic, inputs.ego_frame) == ("/car/odom", "car/base_link")
    with pytest.raises(InputError, match=r"^agent: Blocks-0002: no agent 'bus'; there are: ego, car$"):
        inputs_of_scene(spec.model_dump_json(), Modality.LIDAR, agent="bus")
