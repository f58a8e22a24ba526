"""Renderer, ray caster and annotator read the same geometry, so their results for the same scene must agree."""

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
import pytest

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.actors.skeletons import part_poses
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.assets.regions.static_cache import load_static_scene
from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import Traffic
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, apply, inverse
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES, Tag
from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.simulation.annotation.bev.bev_annotator import BevAnnotator
from simbev_ros.simulation.raycast.scene import Hits, RayScene
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer
from simbev_ros.simulation.sensors.lidar import LidarModel
from simbev_ros.simulation.sensors.mount import map_from_sensor
from simbev_ros.simulation.world.simulation import Simulation

pytestmark = pytest.mark.gl

TICKS = (0, 25)
WHEELS_BELOW_M = 0.9
CAMERAS = [
    Camera(
        type="camera",
        name=f"cam_{yaw % 360}",
        pose={"x_m": 0.3, "z_m": 1.6, "yaw_deg": yaw},
        width_px=320,
        height_px=180,
        distortion=distortion,
    )
    for yaw, distortion in (
        (0, (0.0,) * 5),
        (110, (0.0,) * 5),
        (-110, (0.0,) * 5),
        (20, (-0.3, 0.1, 0.004, -0.006, -0.012)),
    )
]


@dataclass(frozen=True)
class Moment:
    """A scene at one tick, as the renderer and as the rays see it."""

    state: WorldState
    previous: WorldState
    images: list[CameraImages]
    hits: list[Hits]


@pytest.fixture(scope="module")
def static_scene() -> StaticScene:
    planned = next(planned_scenes(load_scenario("demo")))
    return load_static_scene(planned.map, load_network(planned.map))


@pytest.fixture(scope="module")
def rays(static_scene: StaticScene) -> RayScene:
    return RayScene(static_scene, load_models())


@pytest.fixture(scope="module")
def moments(static_scene: StaticScene, rays: RayScene) -> list[Moment]:
    scenario = load_scenario("demo").model_copy(
        update={"seed": 92, "traffic": Traffic(vehicles=60, pedestrians=150, spawn_radius_m=150)}
    )
    planned = next(planned_scenes(scenario))
    network = load_network(planned.map)
    spec = draw_scene(scenario, planned, network)
    renderer = Renderer(static_scene, load_models())
    views = [CameraView(camera.model, camera.pose.ego_from_sensor, camera.modalities) for camera in CAMERAS]
    result = []
    with Simulation(spec, network) as simulation:
        state = simulation.step()
        while state.tick < TICKS[-1]:
            previous, state = state, simulation.step()
            if state.tick in TICKS:
                images = renderer.render(views, RenderFrame(state, previous))
                hits = [_cast(rays, camera, state) for camera in CAMERAS]
                result.append(Moment(state, previous, images, hits))
    renderer.close()
    return result


def _map_from_optical(camera: Camera, state: WorldState) -> Float64Array:
    return map_from_sensor(camera.pose, state) @ SENSOR_FROM_OPTICAL


@cache
def _pixel_rays(camera: Camera) -> Float64Array:
    rows, columns = np.mgrid[: camera.height_px, : camera.width_px]
    return camera.model.rays(np.stack([columns.ravel(), rows.ravel()], axis=1))


def _cast(rays: RayScene, camera: Camera, state: WorldState) -> Hits:
    pose = _map_from_optical(camera, state)
    directions = _pixel_rays(camera) @ pose[:3, :3].T
    rays.update(state, pose[:3, 3], 2000.0, state.ego_ids)
    return rays.cast(pose[None, :3, 3], directions / np.linalg.norm(directions, axis=1, keepdims=True))


def _depth_of(hits: Hits, camera: Camera) -> Float64Array:
    """(H, W) depth of the ray hits along the optical axis."""
    length = np.linalg.norm(_pixel_rays(camera), axis=1)
    return (hits.range_m / length).reshape(camera.height_px, camera.width_px)


def _off_silhouettes(moment: Moment, index: int) -> BoolArray:
    """(H, W) pixels whose neighbors lie on the same smooth surface, in depth and in labels, for both sensors."""
    images, hits = moment.images[index], moment.hits[index]
    assert images.depth is not None and images.semantic is not None and images.instance is not None
    shape = images.depth.shape
    flat = np.ones(shape, bool)
    for depth in (images.depth, _depth_of(hits, CAMERAS[index])):
        disparity = 1.0 / np.maximum(depth, 0.01).astype(np.float64)
        flat &= np.abs(cv2.Laplacian(disparity, cv2.CV_64F, ksize=3)) < 0.01 * np.maximum(disparity, 1e-4)
    labels = (
        images.semantic,
        images.instance,
        hits.tag.reshape(shape),
        hits.object_id.reshape(shape).astype(np.uint16),
    )
    kernel = np.ones((3, 3), np.uint8)
    for label in labels:
        flat &= cv2.dilate(label, kernel) == cv2.erode(label, kernel)
    return flat


@pytest.mark.parametrize("index", range(len(CAMERAS)))
def test_depth_is_the_length_of_the_ray_through_the_pixel(moments: list[Moment], index: int) -> None:
    for moment in moments:
        flat = _off_silhouettes(moment, index)
        depth, expected = moment.images[index].depth[flat], _depth_of(moment.hits[index], CAMERAS[index])[flat]
        assert flat.mean() > 0.3
        assert (np.isfinite(depth) == np.isfinite(expected)).mean() >= 0.999
        both = np.isfinite(depth) & np.isfinite(expected)
        assert (np.abs(depth[both] - expected[both]) < 0.002 + 0.001 * expected[both]).mean() >= 0.999


@pytest.mark.parametrize("index", range(len(CAMERAS)))
def test_semantic_and_instance_are_those_of_the_ray(moments: list[Moment], index: int) -> None:
    for moment in moments:
        images, hits = moment.images[index], moment.hits[index]
        flat = _off_silhouettes(moment, index)
        tag = np.where(np.isfinite(hits.range_m), hits.tag, Tag.SKY).reshape(flat.shape)
        assert (images.semantic[flat] == tag[flat]).mean() >= 0.999
        assert (images.instance[flat] == hits.object_id.reshape(flat.shape)[flat]).mean() >= 0.999


def test_scenes_show_enough_to_compare(moments: list[Moment]) -> None:
    tags = set(np.concatenate([np.unique(images.semantic) for moment in moments for images in moment.images]).tolist())
    assert {Tag.ROAD, Tag.SIDEWALK, Tag.BUILDING, Tag.VEGETATION, Tag.SKY, Tag.ROAD_LINE, Tag.CAR} <= tags
    assert sum(len(np.unique(images.instance)) for moment in moments for images in moment.images) > 15


@pytest.mark.parametrize("index", range(len(CAMERAS)))
def test_flow_is_the_reprojection_of_the_hit_point(moments: list[Moment], index: int) -> None:
    """Static surfaces and vehicle bodies; wheels and limbs, which turn, are compared in the renderer's own tests."""
    camera = CAMERAS[index]
    for moment in moments[1:]:
        hits, flow = moment.hits[index], moment.images[index].flow
        now, before = _map_from_optical(camera, moment.state), _map_from_optical(camera, moment.previous)
        rigid = (hits.object_id == 0) | np.isin(hits.tag, [Tag.CAR, Tag.TRUCK, Tag.BUS])
        chosen = _off_silhouettes(moment, index).ravel() & rigid & np.isfinite(hits.range_m)
        points = apply(now, _pixel_rays(camera)[chosen] * _depth_of(hits, camera).ravel()[chosen, None])
        chosen[chosen] = on_body = (hits.object_id[chosen] == 0) | (points[:, 2] > WHEELS_BELOW_M)
        points = points[on_body]
        points_before = _where_before(points, hits.object_id[chosen], moment)
        optical_before = apply(inverse(before), points_before)
        seen = optical_before[:, 2] > 0.5
        rows, columns = np.divmod(np.flatnonzero(chosen)[seen], camera.width_px)
        expected = np.stack([columns, rows], axis=1) - camera.model.project(optical_before[seen])
        error_px = np.linalg.norm(flow[rows, columns] - expected, axis=1)
        assert (error_px < 0.05).mean() >= 0.99


def _where_before(points_map: Float64Array, object_id: np.ndarray, moment: Moment) -> Float64Array:
    """Positions of the bodies' points one tick before."""
    result = points_map.copy()
    for actor in np.unique(object_id[object_id > 0]):
        poses = [map_from_actors(s.actors[s.actors["id"] == actor])[0] for s in (moment.state, moment.previous)]
        of_actor = object_id == actor
        result[of_actor] = apply(poses[1] @ inverse(poses[0]), points_map[of_actor])
    return result


def test_lidar_points_lie_in_the_box_of_their_actor(moments: list[Moment], rays: RayScene) -> None:
    lidar = Lidar(type="lidar", name="lidar", pose={"z_m": 1.8}, channels=64, columns=1024)
    checked = 0
    for moment in moments:
        state = moment.state
        pose = map_from_sensor(lidar.pose, state)
        rays.update(state, pose[:3, 3], lidar.range_m, state.ego_ids)
        points = LidarModel(lidar, 1, 0.05).scan(rays, state).semantic_points
        points_map = apply(pose, np.stack([points["x"], points["y"], points["z"]], axis=1).astype(np.float64))
        for actor in state.actors[np.isin(state.actors["id"], points["object_id"])]:
            if actor["tag"] == Tag.RIDER:
                continue  # knees swing out of the box of the rest pose
            of_actor = points["object_id"] == actor["id"]
            local = apply(inverse(map_from_actors(actor[None])[0]), points_map[of_actor])
            half = np.array([actor["length"], actor["width"]]) / 2 + 0.02
            assert (np.abs(local[:, :2]) <= half).all()
            assert (local[:, 2] >= -0.02).all() and (local[:, 2] <= actor["height"] + 0.02).all()
            assert (points["tag"][of_actor] == actor["tag"]).all()
            checked += int(of_actor.sum())
    assert checked > 500


@pytest.mark.parametrize("index", [0, 3])
def test_lidar_points_project_to_the_pixels_that_show_them(moments: list[Moment], rays: RayScene, index: int) -> None:
    """Projection as users do it: by the camera model, including distortion."""
    camera = CAMERAS[index]
    lidar = Lidar(type="lidar", name="lidar", pose=camera.pose, channels=64, columns=2048)
    for moment in moments:
        pose = map_from_sensor(lidar.pose, moment.state)
        rays.update(moment.state, pose[:3, 3], lidar.range_m, moment.state.ego_ids)
        points = LidarModel(lidar, 1, 0.05).scan(rays, moment.state).semantic_points
        xyz = np.stack([points["x"], points["y"], points["z"]], axis=1).astype(np.float64)
        optical = apply(inverse(SENSOR_FROM_OPTICAL), xyz)
        optical, points = optical[optical[:, 2] > 0.5], points[optical[:, 2] > 0.5]
        pixels = camera.model.project(optical)
        with np.errstate(invalid="ignore"):
            inside = ((pixels >= 0.0) & (pixels <= [camera.width_px - 1, camera.height_px - 1])).all(axis=1)
        pixels, depth, tag = pixels[inside], optical[inside, 2], points["tag"][inside]
        flat = cv2.erode(_off_silhouettes(moment, index).astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
        column, row = np.round(pixels).astype(int).T
        chosen = flat[row, column]
        images = moment.images[index]
        inverse_depth = cv2.remap(1.0 / images.depth, pixels.astype(np.float32), None, cv2.INTER_LINEAR)[:, 0]
        assert chosen.sum() > 1000
        assert (images.semantic[row, column] == tag)[chosen].mean() >= 0.999
        assert (np.abs(inverse_depth * depth - 1.0) < 0.005)[chosen].mean() >= 0.999


@pytest.mark.parametrize("index", range(len(CAMERAS)))
def test_the_roof_lidar_agrees_with_depth_images_where_the_camera_sees_its_points(
    moments: list[Moment], rays: RayScene, index: int
) -> None:
    camera = CAMERAS[index]
    lidar = Lidar(type="lidar", name="lidar", pose={"z_m": 1.8}, channels=128, columns=2048)
    for moment in moments:
        pose, map_from_optical = map_from_sensor(lidar.pose, moment.state), _map_from_optical(camera, moment.state)
        rays.update(moment.state, pose[:3, 3], lidar.range_m + 5.0, moment.state.ego_ids)
        points = LidarModel(lidar, 1, 0.05).scan(rays, moment.state).semantic_points
        points_map = apply(pose, np.stack([points["x"], points["y"], points["z"]], axis=1).astype(np.float64))
        optical = apply(inverse(map_from_optical), points_map)
        ahead = np.flatnonzero(optical[:, 2] > 0.5)
        pixels = camera.model.project(optical[ahead])
        with np.errstate(invalid="ignore"):
            inside = ((pixels >= 0.0) & (pixels <= [camera.width_px - 1, camera.height_px - 1])).all(axis=1)
        pixels, seen = pixels[inside].astype(np.float32), ahead[inside]
        from_camera_m = points_map[seen] - map_from_optical[:3, 3]
        far = np.linalg.norm(from_camera_m, axis=1)
        first = rays.cast(map_from_optical[None, :3, 3], from_camera_m / far[:, None]).range_m
        free = np.flatnonzero(np.abs(first - far) < 0.02)[:30_000]  # OpenCV's limit for one call
        inverse_depth = cv2.remap(1.0 / moment.images[index].depth, pixels[free], None, cv2.INTER_LINEAR)[:, 0]
        assert len(free) > 1000
        depth = optical[seen[free], 2]
        assert np.median(np.abs(1.0 - inverse_depth * depth) * depth) < 0.01


def test_bev_cells_are_the_projection_of_the_meshes(moments: list[Moment], static_scene: StaticScene) -> None:
    """Compares with a point-in-triangle test of every cell center with every triangle, on a part of the cells."""
    grid = BevGrid(120, 120, 0.5)
    annotator = BevAnnotator(static_scene, load_models())
    rng = np.random.default_rng(0)
    intersection, union = np.zeros(len(BEV_CLASSES)), np.zeros(len(BEV_CLASSES))
    for moment in moments:
        labels = annotator.labels(moment.state, grid).ravel()
        cells = rng.choice(labels.size, 3000, replace=False)
        ego = moment.state.ego
        heading = np.array([[np.cos(ego["yaw"]), -np.sin(ego["yaw"])], [np.sin(ego["yaw"]), np.cos(ego["yaw"])]])
        centers = grid.centers_ego.reshape(-1, 2)[cells] @ heading.T.astype(np.float64) + [ego["x"], ego["y"]]
        for name, triangles in _class_triangles(moment.state, static_scene).items():
            index = BEV_CLASSES.index(name)
            truth, found = _inside_any(centers, triangles), labels[cells] >> index & 1 == 1
            intersection[index] += (truth & found).sum()
            union[index] += (truth | found).sum()
    present = union > 0
    assert {"road", "road_line", "sidewalk", "crosswalk", "car"} <= {BEV_CLASSES[i] for i in np.flatnonzero(present)}
    assert (intersection[present] / union[present]).min() >= 0.99


def _class_triangles(state: WorldState, static_scene: StaticScene) -> dict[str, Float64Array]:
    """Class → (T, 3, 2) triangles in plan, collected independently of the code under test, vertex by vertex."""
    found: dict[str, list[Float64Array]] = {name: [] for name in BEV_CLASSES}
    for tile in static_scene.tiles:
        corners = tile.mesh.vertices[tile.mesh.triangles][:, :, :2].astype(np.float64) + tile.origin_m[:2]
        for tag, name in ((Tag.ROAD, "road"), (Tag.ROAD_LINE, "road_line"), (Tag.SIDEWALK, "sidewalk")):
            found[name].append(corners[tile.mesh.triangle_tag == tag])
        for name, mesh in tile.surfaces.items():
            found[name].append(mesh.vertices[mesh.triangles][:, :, :2].astype(np.float64) + tile.origin_m[:2])
    models = load_models()
    for row in range(len(state.actors)):
        actor = state.actors[row : row + 1]
        blueprint = int(actor["blueprint"][0])
        name = load_blueprints()[blueprint].box_class or Tag(int(actor["tag"][0])).name.lower()
        if name not in found:
            continue
        model = models[blueprint]
        poses = map_from_actors(actor)[0] @ part_poses(model, actor)[0]
        vertices = np.empty((len(model.mesh.vertices), 3))
        for part, pose in enumerate(poses):
            of_actor = model.mesh.part == part
            vertices[of_actor] = apply(pose, model.mesh.vertices[of_actor].astype(np.float64))
        found[name].append(vertices[model.mesh.triangles][:, :, :2])
    return {name: np.concatenate(parts) for name, parts in found.items() if parts}


def _inside_any(points: Float64Array, triangles: Float64Array) -> BoolArray:
    """(N,) points that lie in any triangle, by the signs of three cross products."""
    low, high = points.min(axis=0), points.max(axis=0)
    triangles = triangles[(triangles.max(axis=1) >= low).all(axis=1) & (triangles.min(axis=1) <= high).all(axis=1)]
    inside = np.zeros(len(points), bool)
    for start_row in range(0, len(triangles), 100):
        block = triangles[start_row : start_row + 100]
        bounds = block.reshape(-1, 2)
        open_ = np.flatnonzero(~inside & ((points >= bounds.min(axis=0)) & (points <= bounds.max(axis=0))).all(axis=1))
        signs = []
        for k in range(3):
            start, edge = block[:, k], block[:, (k + 1) % 3] - block[:, k]
            offset = points[open_, None] - start[None]
            signs.append(edge[None, :, 0] * offset[..., 1] - edge[None, :, 1] * offset[..., 0])
        stacked = np.stack(signs)
        first, second = block[:, 1] - block[:, 0], block[:, 2] - block[:, 0]
        area = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) > 1e-12
        inside[open_] = (((stacked >= 0).all(axis=0) | (stacked <= 0).all(axis=0)) & area).any(axis=1)
    return inside


def test_box_classes_and_bev_classes_share_their_names() -> None:
    assert set(BOX_CLASSES) - set(BEV_CLASSES) == {"traffic_light", "traffic_sign"}
