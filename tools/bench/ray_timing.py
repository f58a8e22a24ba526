"""Times the rays of the paper's lidar and radars, their parts, and one merged mesh for comparison."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.load import load_scenario
from simbev_ros.config.radar import Radar
from simbev_ros.foundation.process_memory import keep_freed_memory
from simbev_ros.foundation.types import Float32Array, Float64Array
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.raycast.static import StaticTriangles
from simbev_ros.simulation.sensors.lidar import LidarModel
from simbev_ros.simulation.sensors.mount import map_from_sensor, vector
from simbev_ros.simulation.sensors.radar import RadarModel, scan_radars
from tools.bench.camera_scene import CameraScene
from tools.bench.merged_scene import MergedScene
from tools.bench.stopwatch import Cost, Stopwatch

_TURN_S = 0.05
_BESIDE_EGO_M = 5.0
_SAME_M = 1e-3


@dataclass(frozen=True, slots=True)
class RayCost(Cost):
    """Time of casting rays."""

    rays_per_s: float


@dataclass(frozen=True, slots=True)
class RayTiming:
    """The scene and the times of its rays.

    Attributes:
        map: Name of the town.
        actors: Number of actors in the world.
        near_actors: Number of actors within the range of the rays.
        triangles: Number of triangles of the static scene near the ego and of all actors.
        rays: Number of lidar rays.
        frames: Number of timed ticks, of which medians are taken.
        whole: Times of whole sensors, from the state of the world to tables of points.
        parts: Times of the parts of a lidar scan.
        merged: Times of the lidar rays with one merged mesh in plain Open3D.
        whole_ratio: Time of the merged mesh over that of ours, including the construction for each tick.
        cast_ratio: Time of the merged mesh over that of ours, without the construction of the merged mesh.
        agreement: Share of the lidar rays whose ranges agree within 1 mm.
    """

    map: str
    actors: int
    near_actors: int
    triangles: int
    rays: int
    frames: int
    whole: list[RayCost]
    parts: list[RayCost]
    merged: list[RayCost]
    whole_ratio: float
    cast_ratio: float
    agreement: float

    def rows(self) -> list[tuple[str, ...]]:
        """Rows of a table: group, part, median, minimum and processor time per tick in ms, rays per second."""
        groups = ("sensors", self.whole), ("parts", self.parts), ("Open3D, merged", self.merged)
        return [
            (
                group,
                cost.name,
                *(f"{ms:.1f}" for ms in (cost.wall_ms, cost.least_ms, cost.cpu_ms)),
                f"{cost.rays_per_s:,.0f}",
            )
            for group, costs in groups
            for cost in costs
        ]

    def comparison(self) -> str:
        """A sentence on the comparison with the merged mesh."""
        return (
            f"One merged mesh in plain Open3D takes {self.whole_ratio:.1f} times our time, {self.cast_ratio:.1f} times "
            f"when it is not rebuilt; {100 * self.agreement:.2f} % of the ranges are the same within 1 mm"
        )


def timed_rays(scene: CameraScene, progress: Callable[[], None] = lambda: None) -> RayTiming:
    """Scan the moments of a scene with the lidar and the radars of the paper's rig.

    Args:
        scene: At least two moments; the first one is for warm-up.
        progress: Called after each moment.
    """
    keep_freed_memory()
    rig = load_scenario("paper").rig
    [lidar] = rig.of_type(Lidar)
    sensors = _Sensors(scene, lidar, rig.of_type(Radar))
    agreed: list[float] = []
    for state in scene.states:
        sensors.time_whole(state)
        agreed.append(sensors.time_parts(state))
        progress()
    watch, rays, state = sensors.watch, lidar.channels * lidar.columns, scene.states[-1]
    whole = [_cost(watch, name, rays) for name in (_POINTS, _BOTH)] + [_cost(watch, _RADARS, sensors.radar_rays)]
    parts = [_cost(watch, name, rays) for name in (_PLACED, _STATIC, _CAST, _REBUILT)]
    merged = [_cost(watch, name, rays) for name in (_BUILT, _PLAIN)]
    ours_ms = parts[0].wall_ms + parts[2].wall_ms
    return RayTiming(
        map=scene.map,
        actors=len(state.actors),
        near_actors=int((state.distance_to_ego_m < lidar.range_m).sum()),
        triangles=sensors.merged.triangles,
        rays=rays,
        frames=len(scene.states) - 1,
        whole=whole,
        parts=parts,
        merged=merged,
        whole_ratio=(merged[0].wall_ms + merged[1].wall_ms) / ours_ms,
        cast_ratio=merged[1].wall_ms / ours_ms,
        agreement=min(agreed),
    )


def _cost(watch: Stopwatch, name: str, rays: int) -> RayCost:
    cost = watch.cost(name)
    return RayCost(**asdict(cost), rays_per_s=1e3 * rays / cost.wall_ms)


_POINTS, _BOTH, _RADARS = "lidar: points", "lidar: points and semantic points", "radars"
_PLACED, _STATIC, _CAST = "actors placed", "cast, static triangles alone", "cast, static triangles and actors"
_REBUILT = "static triangles built (once in 128 m)"
_BUILT, _PLAIN = "actors posed, all merged, scene built", "cast"


class _Sensors:
    """The sensors and the stopwatch that times them."""

    def __init__(self, scene: CameraScene, lidar: Lidar, radars: Sequence[Radar]) -> None:
        models = load_models()
        self.watch = Stopwatch()
        self._static = scene.static
        self._lidar = lidar
        self._both = LidarModel(lidar, 0, _TURN_S)
        self._points = LidarModel(lidar.model_copy(update={"semantic_points": False}), 0, _TURN_S)
        self._radars = [RadarModel(radar, 0, _TURN_S) for radar in radars]
        self.radar_rays = sum(model.rays for model in self._radars)
        self._reach_m = lidar.range_m + _BESIDE_EGO_M
        self._rays, self._alone = RayScene(scene.static, models), RayScene(scene.static, models)
        self.merged = MergedScene(scene.static, models, vector(scene.states[0].ego, "x y z"), self._reach_m)
        self._previous: WorldState | None = None

    def time_whole(self, state: WorldState) -> None:
        """Time whole sensors, each as if it were alone."""

        def scan(model: LidarModel) -> None:
            self._update(state)
            model.scan(self._rays, state)

        def scan_all_radars() -> None:
            self._update(state)
            scan_radars(self._radars, self._rays, state, self._previous)

        self.watch.run(_POINTS, lambda: scan(self._points))
        self.watch.run(_BOTH, lambda: scan(self._both))
        self.watch.run(_RADARS, scan_all_radars)
        self._previous = state

    def time_parts(self, state: WorldState) -> float:
        """Time the parts of a lidar scan and the merged mesh; return the share of rays that agree."""
        place_m = vector(state.ego, "x y z")
        origin_m, directions = self._lidar_rays(state)
        fresh = StaticTriangles(self._static)
        self.watch.run(_REBUILT, lambda: fresh.triangles_around(place_m, self._reach_m))
        self._alone.update(state, place_m, self._reach_m, set(state.actors["id"].tolist()))
        self.watch.run(_STATIC, lambda: self._alone.cast(origin_m[None], directions))
        self.watch.run(_PLACED, lambda: self._update(state))
        ours = self.watch.run(_CAST, lambda: self._rays.cast(origin_m[None], directions))
        self.watch.run(_BUILT, lambda: self.merged.build(state, state.ego_ids))
        plain_m = self.watch.run(_PLAIN, lambda: self.merged.ranges_m(origin_m, directions))
        reach_m = np.float32(self._lidar.range_m)
        return float((np.abs(np.minimum(ours.range_m, reach_m) - np.minimum(plain_m, reach_m)) < _SAME_M).mean())

    def _update(self, state: WorldState) -> None:
        self._rays.update(state, vector(state.ego, "x y z"), self._reach_m, state.ego_ids)

    def _lidar_rays(self, state: WorldState) -> tuple[Float64Array, Float32Array]:
        pose = map_from_sensor(self._lidar.pose, state)
        rotation = pose[:3, :3].astype(np.float32)
        return pose[:3, 3], np.einsum("ni,ji->nj", self._both.pattern.directions, rotation)
