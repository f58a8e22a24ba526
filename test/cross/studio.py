"""A simulated town at one time, and camera poses in it, for image tests."""

from collections.abc import Sequence

import numpy as np

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.regions.static_cache import load_static_scene
from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.config.weather import Season
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.region import Reach
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.scene.agents import AgentView, agent_view
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer
from simbev_ros.simulation.world.simulation import Simulation

EXACT = ("semantic", "instance", "depth", "flow")
VIEW_M = 700.0


class Studio:
    """A town at one time, with its static scene."""

    def __init__(self, town: str, seed: int, season: Season = "summer") -> None:
        """Simulate some seconds, until all actors are moving, and keep the last two ticks."""
        scenario = Scenario.model_validate(
            {
                "seed": seed,
                "scenes": [{"map": town, "train": 1}],
                "rig": Rig(sensors=()),
                "weather": {"season": season},
                "time": {"warm_up_s": 3.0, "duration_s": 4.0},
                "traffic": {"vehicles": 20, "pedestrians": 60, "spawn_radius_m": 150.0},
            }
        )
        planned = next(planned_scenes(scenario))
        network = load_network(planned.map)
        self.spec = draw_scene(scenario, planned, network)
        with Simulation(self.spec, network) as simulation:
            states = [simulation.step() for _ in range(self.spec.warm_up_ticks)]
        self.state, self.previous = states[-1], states[-2]
        ego = self.state.ego
        self.origin_m = np.array([ego["x"], ego["y"], ego["z"]])
        reach = Reach((float(ego["x"]), float(ego["y"])), VIEW_M)
        self.static = load_static_scene(self.spec.map, network, reach=reach)
        self.models = load_models()
        self._renderer = Renderer(self.static, self.models)

    def images(self, views: Sequence[CameraView], agent: AgentView | None = None) -> list[CameraImages]:
        """Images of the ego's cameras, or of those of another agent."""
        now, before = ((agent or agent_view(self.spec)).ego_state(state) for state in (self.state, self.previous))
        return self._renderer.render(views, RenderFrame(now, before))


def random_views(state: WorldState, camera: PinholeCamera, count: int, seed: int) -> list[CameraView]:
    """Views in turn from the ego in any direction, and from nearby toward a moving pedestrian, rider or vehicle."""
    rng = np.random.default_rng(seed)
    actors = state.actors
    moving = actors[(np.hypot(actors["vx"], actors["vy"]) > 0.5) & ~np.isin(actors["id"], sorted(state.ego_ids))]
    views = []
    for index in range(count):
        if index % 2 == 0:
            position_m, tilt = rng.uniform([-1.0, -1.0, 1.0], [2.0, 1.0, 4.0]), rng.uniform([-0.1, -0.2], [0.1, 0.4])
            pose = matrices_from_xyz_rpy(position_m, np.array([*tilt, rng.uniform(-np.pi, np.pi)]))
        else:
            pose = inverse(map_from_actors(state.ego.reshape(1))[0]) @ _looking_at(rng.choice(moving), rng)
        views.append(CameraView(camera, pose, EXACT))
    return views


def _looking_at(actor: np.void, rng: np.random.Generator) -> Float64Array:
    """(4, 4) map from camera, for a camera some meters away from an actor."""
    yaw, distance_m, height_m = rng.uniform([-np.pi, 3.0, 0.5], [np.pi, 9.0, 2.5])
    away_m = distance_m * np.array([np.cos(yaw), np.sin(yaw)])
    eye_m = np.array([actor["x"] + away_m[0], actor["y"] + away_m[1], actor["z"] + height_m])
    return matrices_from_xyz_rpy(eye_m, np.array([0.05, np.arctan2(height_m - 0.8, distance_m), yaw + np.pi]))
