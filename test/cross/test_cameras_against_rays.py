"""Semantic, instance, depth and flow images of simulated towns against Embree rays through the pixels' centres.

The truth is that of the exact meshes. What is drawn from afar in their stead has to pass for them.
"""

from collections.abc import Sequence

import numpy as np
import pytest
from camera_truth import Agreement, Triangles, agreement, truth_of

from simbev_ros.assets.catalogue import load_models
from simbev_ros.assets.static_cache import load_static_scene
from simbev_ros.config.camera import MODALITIES
from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.geometry.transforms import inverse, matrices_from_xyz_rpy
from simbev_ros.maps.build import load_network
from simbev_ros.maps.region import Reach
from simbev_ros.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.render.renderer import Renderer
from simbev_ros.scene.draw import draw_scene, planned_scenes
from simbev_ros.scene.state import WorldState, map_from_actors
from simbev_ros.types import Float64Array
from simbev_ros.world.simulation import Simulation

pytestmark = pytest.mark.gl

EXACT = ("semantic", "instance", "depth", "flow")
FOV_RAD = float(np.radians(80.0))
SMALL = PinholeCamera.from_field_of_view(320, 180, FOV_RAD)
MEDIUM = PinholeCamera.from_field_of_view(640, 360, FOV_RAD)
LENS = LensCamera(320, 180, 165.0, 160.0, 162.0, 85.0, distortion=(-0.25, 0.08, 0.001, -0.0005, -0.01))
LARGE = PinholeCamera.from_field_of_view(800, 450, FOV_RAD)
VIEW_M = 700.0
TOWNS = ("Town02", "Town03", "Town04", "Town07", "Town10HD")


class Studio:
    """A simulated moment of a town, and its static surroundings."""

    def __init__(self, town: str, seed: int) -> None:
        """Two ticks, after some seconds in which all have set off."""
        scenario = Scenario.model_validate(
            {
                "seed": seed,
                "scenes": [{"map": town, "train": 1}],
                "rig": Rig(sensors=()),
                "time": {"warm_up_s": 3.0, "duration_s": 4.0},
                "traffic": {"vehicles": 20, "pedestrians": 60, "spawn_radius_m": 150.0},
            }
        )
        planned = next(planned_scenes(scenario))
        network = load_network(planned.map)
        spec = draw_scene(scenario, planned, network)
        with Simulation(spec, network) as simulation:
            states = [simulation.step() for _ in range(spec.warm_up_ticks)]
        self.state, self.previous = states[-1], states[-2]
        ego = self.state.ego
        self.origin_m = np.array([ego["x"], ego["y"], ego["z"]])
        reach = Reach((float(ego["x"]), float(ego["y"])), VIEW_M)
        self.static = load_static_scene(planned.map, network, reach=reach)
        self.models = load_models()
        self._renderer = Renderer(self.static, self.models)

    def images(self, views: Sequence[CameraView]) -> list[CameraImages]:
        return self._renderer.render(views, RenderFrame(self.state, self.previous))

    def agreements(self, views: Sequence[CameraView]) -> list[Agreement]:
        still = Triangles.of_static(self.static, self.origin_m)
        moving = Triangles.of_actors(self.models, self.state, self.previous, self.origin_m)
        states = (self.state, self.previous)
        return [
            agreement(images, truth_of(view, still, moving, states, self.origin_m))
            for view, images in zip(views, self.images(views), strict=True)
        ]


def random_views(state: WorldState, camera: PinholeCamera, count: int, seed: int) -> list[CameraView]:
    """By turns from the ego in any direction, and from nearby at an actor that walks, rides or drives."""
    rng = np.random.default_rng(seed)
    actors = state.actors
    moving = actors[(np.hypot(actors["vx"], actors["vy"]) > 0.5) & ~np.isin(actors["id"], sorted(state.ego_ids))]
    views = []
    for index in range(count):
        if index % 2 == 0:
            place_m, tilt = rng.uniform([-1.0, -1.0, 1.0], [2.0, 1.0, 4.0]), rng.uniform([-0.1, -0.2], [0.1, 0.4])
            pose = matrices_from_xyz_rpy(place_m, np.array([*tilt, rng.uniform(-np.pi, np.pi)]))
        else:
            pose = inverse(map_from_actors(state.ego.reshape(1))[0]) @ _looking_at(rng.choice(moving), rng)
        views.append(CameraView(camera, pose, EXACT))
    return views


def _looking_at(actor: np.void, rng: np.random.Generator) -> Float64Array:
    """(4, 4) map from a camera some metres away from an actor."""
    yaw, distance_m, height_m = rng.uniform([-np.pi, 3.0, 0.5], [np.pi, 9.0, 2.5])
    away_m = distance_m * np.array([np.cos(yaw), np.sin(yaw)])
    eye_m = np.array([actor["x"] + away_m[0], actor["y"] + away_m[1], actor["z"] + height_m])
    return matrices_from_xyz_rpy(eye_m, np.array([0.05, np.arctan2(height_m - 0.8, distance_m), yaw + np.pi]))


def check(found: Sequence[Agreement], jointed_px: int) -> None:
    """Every view for itself; the flow of wheels and limbs in all views together, of which there must be enough."""
    for each in found:
        assert each.inner > 0.3
        assert each.depth >= 0.999
        assert each.semantic >= 0.999
        assert each.instance >= 0.999
        assert np.median(each.flow_px) < 0.02
        assert np.quantile(each.flow_px, 0.99) < 0.2
    error_px = np.concatenate([each.jointed_flow_px for each in found])
    assert len(error_px) > jointed_px
    assert np.median(error_px) < 0.02
    assert np.quantile(error_px, 0.99) < 0.2


@pytest.fixture(scope="module")
def blocks() -> Studio:
    return Studio("Blocks", 3)


def test_images_of_a_small_town_are_those_of_rays(blocks: Studio) -> None:
    check(blocks.agreements(random_views(blocks.state, MEDIUM, 4, 1)), 1000)


def test_a_lens_that_distorts_shows_what_its_rays_hit(blocks: Studio) -> None:
    """Next to silhouettes, and in depth next to edges, it is right to a pixel only: its images are resampled."""
    for each in blocks.agreements(random_views(blocks.state, LENS, 4, 1)):
        assert each.inner > 0.3
        assert each.labels >= 0.999
        assert each.depth >= 0.99
        assert np.median(each.flow_px) < 0.02
        assert np.quantile(each.flow_px, 0.99) < 0.2


def test_the_quality_of_pictures_changes_no_label(blocks: Studio) -> None:
    [view] = random_views(blocks.state, SMALL, 1, 1)
    [medium] = blocks.images([view])
    renderer = Renderer(blocks.static, blocks.models, quality="low")
    colored = CameraView(view.camera, view.ego_from_sensor, MODALITIES)
    [low] = renderer.render([colored], RenderFrame(blocks.state, blocks.previous))
    renderer.close()
    for name in EXACT:
        assert getattr(low, name).tobytes() == getattr(medium, name).tobytes(), name


@pytest.mark.slow
@pytest.mark.parametrize("town", TOWNS)
def test_images_of_towns_are_those_of_rays(town: str) -> None:
    studio = Studio(town, 11)
    check(studio.agreements(random_views(studio.state, LARGE, 4, 11)), 1000)
