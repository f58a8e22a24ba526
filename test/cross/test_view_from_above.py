"""A camera of a roadside unit that looks down on the road sees the roofs of cars, the ego's too, as rays do."""

import numpy as np
import pytest
from camera_truth import Triangles, agreement, truth_of
from several_agents import roadside_unit, with_agents
from studio import EXACT, Studio

from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.semantics import Tag
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.schema.scene.state import EGO_ID
from simbev_ros.simulation.render.frame import CameraView

pytestmark = pytest.mark.gl

CAMERA = PinholeCamera.from_field_of_view(480, 480, float(np.radians(90.0)))


@pytest.mark.parametrize("height_m", [30.0, pytest.param(100.0, marks=pytest.mark.slow)])
def test_a_camera_above_the_road_sees_what_rays_hit_and_the_roofs_of_cars(blocks: Studio, height_m: float) -> None:
    ego = blocks.state.ego
    place = {"x_m": float(ego["x"]), "y_m": float(ego["y"]), "z_m": float(ego["z"]), "yaw_rad": 0.3}
    view = agent_view(with_agents(blocks.spec, roadside_unit() | {"station": place}), "rsu")
    camera = CameraView(CAMERA, Pose(z_m=height_m, pitch_deg=90.0).ego_from_sensor, EXACT)
    states = view.ego_state(blocks.state), view.ego_state(blocks.previous)
    still = Triangles.of_static(blocks.static, blocks.origin_m)
    moving = Triangles.of_actors(blocks.models, *states, blocks.origin_m)
    [images] = blocks.images([camera], view)
    found = agreement(images, truth_of(camera, still, moving, states, blocks.origin_m))
    assert found.inner > 0.3
    assert min(found.semantic, found.instance, found.depth) >= 0.999
    assert images.depth is not None and images.instance is not None and images.semantic is not None
    is_ego = images.instance == EGO_ID
    assert np.all(images.semantic[is_ego] == Tag.CAR)
    above_ground_m = height_m - images.depth[is_ego]
    assert above_ground_m.max() == pytest.approx(float(ego["height"]), abs=0.1)
    area_m2 = is_ego.sum() * (2.0 * (height_m - ego["height"]) / CAMERA.width_px) ** 2
    assert area_m2 == pytest.approx(float(ego["length"] * ego["width"]), rel=0.3)
