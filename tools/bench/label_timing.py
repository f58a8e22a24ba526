"""Times the labels of a tick: grid, boxes, points, views, vector map and voxels, with a plain grid for comparison."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.config.annotation import Occupancy
from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.load import load_scenario
from simbev_ros.config.radar import Radar
from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.process_memory import keep_freed_memory
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.maps.build import load_network
from simbev_ros.maps.source import map_spec
from simbev_ros.schema.box_points import add_point_counts
from simbev_ros.schema.map_points import map_points
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.annotation.bev.bev_annotator import BevAnnotator
from simbev_ros.simulation.annotation.bev.levels import Levels
from simbev_ros.simulation.annotation.boxes.boxes import boxes_around_ego
from simbev_ros.simulation.annotation.boxes.extents import Extents
from simbev_ros.simulation.annotation.boxes.standing import find_static_objects
from simbev_ros.simulation.annotation.occupancy.occupancy import OccupancyAnnotator, occupied_voxels
from simbev_ros.simulation.annotation.vector_map.vector_map import VectorMap
from simbev_ros.simulation.annotation.visibility.views import ViewAnnotator, visibility
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.render.frame import CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer
from simbev_ros.simulation.sensors.lidar import LidarModel
from simbev_ros.simulation.sensors.mount import map_from_sensor, vector
from simbev_ros.simulation.sensors.radar import RadarModel, scan_radars
from tools.bench.camera_scene import CameraScene
from tools.bench.plain_grid import PlainGrid
from tools.bench.stopwatch import Cost, Stopwatch

_TURN_S = 0.05
_BESIDE_EGO_M = 5.0
_NEAR_M = 100.0

_GRID, _BOXES, _POINTS = "grid", "boxes", "points inside boxes"
_VIEWS, _ROADS, _VOXELS = "views", "vector map", "occupancy"
_PLAIN = "grid in shapely"

_Cloud = tuple[Pose, Table]


@dataclass(frozen=True, slots=True)
class LabelTiming:
    """The annotated scene and the times of its labels.

    Attributes:
        map: Name of the town.
        actors: Number of actors in the world.
        near_actors: Number of actors up to 100 m from the ego.
        boxes: Number of boxes at the last tick.
        points: Number of lidar and radar points at the last tick.
        frames: Number of timed ticks, of which medians are taken.
        costs: Time of each label.
        every_tick: Time of grid, boxes and points together.
        plain: Time of the plain grid.
        ratio: Time of the plain grid over that of ours.
        agreement: Minimum share of cells with the same labels in both grids.
    """

    map: str
    actors: int
    near_actors: int
    boxes: int
    points: int
    frames: int
    costs: list[Cost]
    every_tick: Cost
    plain: Cost
    ratio: float
    agreement: float

    def title(self) -> str:
        """One line on the scene."""
        return (
            f"labels on {self.map}, {self.near_actors} of {self.actors} actors within {_NEAR_M:.0f} m, "
            f"{self.boxes} boxes, {self.points:,} points"
        )

    def rows(self) -> list[tuple[str, ...]]:
        """Rows of a table: label, then median, minimum and processor time per tick in ms."""
        return [
            (cost.name, *(f"{ms:.1f}" for ms in (cost.wall_ms, cost.least_ms, cost.cpu_ms)))
            for cost in (*self.costs, self.every_tick, self.plain)
        ]

    def comparison(self) -> str:
        """A sentence on the comparison with the plain grid."""
        return (
            f"The same triangles asked in shapely for the cell centers in them: {self.ratio:.0f} times our time; "
            f"{100 * self.agreement:.3f} % of the cells have the same labels"
        )


def timed_labels(scene: CameraScene, progress: Callable[[], None] = lambda: None) -> LabelTiming:
    """Annotate the moments of a scene as the paper does, and with voxels and a vector map.

    Args:
        scene: At least two moments; the first one is for warm-up.
        progress: Called after each moment.

    Raises:
        RenderError: OpenGL is not usable here; instance images are drawn with it.
    """
    keep_freed_memory()
    annotators = _Annotators(scene)
    agreed = []
    for state in scene.states:
        annotators.time(state)
        agreed.append(annotators.time_plain(state))
        progress()
    watch, state = annotators.watch, scene.states[-1]
    grid, plain = watch.cost(_GRID), watch.cost(_PLAIN)
    return LabelTiming(
        map=scene.map,
        actors=len(state.actors),
        near_actors=int((state.distance_to_ego_m <= _NEAR_M).sum()),
        boxes=annotators.boxes,
        points=annotators.points,
        frames=len(scene.states) - 1,
        costs=[
            *(watch.cost(name) for name in (_GRID, _BOXES, _POINTS)),
            watch.cost(_VIEWS, title=f"{_VIEWS} of {len(annotators.cameras)} cameras"),
            *(watch.cost(name) for name in (_ROADS, _VOXELS)),
        ],
        every_tick=watch.cost(_GRID, _BOXES, _POINTS, title=f"{_GRID}, {_BOXES} and points"),
        plain=plain,
        ratio=plain.wall_ms / grid.wall_ms,
        agreement=min(agreed),
    )


class _Annotators:
    """The annotators and the stopwatch that times them."""

    def __init__(self, scene: CameraScene) -> None:
        scenario, models = load_scenario("paper"), load_models()
        network = load_network(map_spec(scene.map))
        self.watch, self.boxes, self.points = Stopwatch(), 0, 0
        self._annotation = scenario.annotation
        self._occupancy = self._annotation.occupancy or Occupancy()
        self._levels, self._standing = Levels(network.layout), find_static_objects(network)
        self._extents = Extents(models)
        self._bev, self._voxels = BevAnnotator(scene.static, models), OccupancyAnnotator(scene.static, models)
        self._roads = VectorMap(network, network.layout)
        self._plain = PlainGrid(scene.static, models, self._annotation.bev.grid)
        self._rays = RayScene(scene.static, models)
        [self._lidar] = scenario.rig.of_type(Lidar)
        cameras = scenario.rig.of_type(Camera)
        self.cameras = [CameraView(each.model, each.pose.ego_from_sensor, ("instance",)) for each in cameras]
        self._renderer, self._views = Renderer(scene.static, models), ViewAnnotator(models)
        self._lidar_model = LidarModel(self._lidar, 0, _TURN_S)
        self._radars = [RadarModel(radar, 0, _TURN_S) for radar in scenario.rig.of_type(Radar)]

    def time(self, state: WorldState) -> None:
        """Time every label of a tick."""
        run, annotation, occupancy = self.watch.run, self._annotation, self._occupancy
        lidar, radar = self._clouds(state)
        level = self._levels.ego_level(state)
        run(_GRID, lambda: self._bev.labels(state, annotation.bev.grid, level))
        table = run(
            _BOXES, lambda: boxes_around_ego(state, annotation.box_radius_m, level, self._extents, self._standing)
        )
        run(_POINTS, lambda: add_point_counts(table, *(_map_points(clouds, state) for clouds in (lidar, radar))))
        drawn = self._renderer.render(self.cameras, RenderFrame(state))
        images = [each.instance for each in drawn if each.instance is not None]
        run(_VIEWS, lambda: visibility(table["id"], self._views.views(state, table, self.cameras, images)))
        run(_ROADS, lambda: self._roads.record(state, level))
        run(_VOXELS, lambda: occupied_voxels(self._voxels.tags(state, occupancy.grid, state.ego_ids), occupancy.grid))
        self.boxes, self.points = len(table), sum(len(cloud) for _, cloud in (*lidar, *radar))

    def time_plain(self, state: WorldState) -> float:
        """Time the plain grid and return the share of cells with the same labels, regardless of levels."""
        plain = self.watch.run(_PLAIN, lambda: self._plain.labels(state))
        return float((plain == self._bev.labels(state, self._annotation.bev.grid)).mean())

    def _clouds(self, state: WorldState) -> tuple[list[_Cloud], list[_Cloud]]:
        """The points of the lidar and of the radars, with the poses of the sensors."""
        reach_m = self._lidar.range_m + _BESIDE_EGO_M
        self._rays.update(state, vector(state.ego, "x y z"), reach_m, state.ego_ids)
        points = self._lidar_model.scan(self._rays, state).points
        assert points is not None
        radar = zip(self._radars, scan_radars(self._radars, self._rays, state, None), strict=True)
        return [(self._lidar.pose, points)], [(model.radar.pose, cloud) for model, cloud in radar]


def _map_points(clouds: Sequence[_Cloud], state: WorldState) -> list[Float64Array]:
    return [map_points(cloud, map_from_sensor(pose, state)) for pose, cloud in clouds]
