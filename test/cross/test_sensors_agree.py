"""Renderer and lidar read the same geometry, so their results for the same scene must agree."""

import cv2
import numpy as np
import pytest
from point_distance import xyz
from studio import Studio

from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, apply, inverse
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES, Tag
from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.schema.scene.state import map_from_actors
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.render.frame import CameraImages, CameraView
from simbev_ros.simulation.sensors.lidar import LidarModel
from simbev_ros.simulation.sensors.mount import map_from_sensor

pytestmark = pytest.mark.gl

CAMERAS = [
    Camera(
        type="camera",
        name=f"cam_{yaw % 360}",
        pose={"x_m": 0.3, "z_m": 1.6, "yaw_deg": yaw},
        width_px=320,
        height_px=180,
        distortion=distortion,
    )
    for yaw, distortion in ((-110, (0.0,) * 5), (20, (-0.3, 0.1, 0.004, -0.006, -0.012)))
]
ROOF = Lidar(type="lidar", name="lidar", pose={"z_m": 1.8}, channels=64, columns=2048)
each_camera = pytest.mark.parametrize("index", range(len(CAMERAS)))


@pytest.fixture(scope="module")
def rays(blocks: Studio) -> RayScene:
    return RayScene(blocks.static, blocks.models)


@pytest.fixture(scope="module")
def images(blocks: Studio) -> list[CameraImages]:
    return blocks.images(
        [CameraView(camera.model, camera.pose.ego_from_sensor, camera.modalities) for camera in CAMERAS]
    )


@pytest.fixture(scope="module")
def roof_points(blocks: Studio, rays: RayScene) -> Table:
    return _scan(ROOF, blocks, rays)


def _scan(lidar: Lidar, studio: Studio, rays: RayScene) -> Table:
    rays.update(studio.state, studio.origin_m, lidar.range_m + 5.0, studio.state.ego_ids)
    points = LidarModel(lidar, 1, 0.05).scan(rays, studio.state).semantic_points
    assert points is not None
    return points


def _off_silhouettes(images: CameraImages) -> BoolArray:
    """(H, W) pixels whose neighbors show the same smooth surface, in depth and in labels."""
    assert images.depth is not None and images.semantic is not None and images.instance is not None
    disparity = 1.0 / np.maximum(images.depth, 0.01).astype(np.float64)
    flat = np.abs(cv2.Laplacian(disparity, cv2.CV_64F, ksize=3)) < 0.01 * np.maximum(disparity, 1e-4)
    kernel = np.ones((3, 3), np.uint8)
    for label in (images.semantic, images.instance):
        flat &= cv2.dilate(label, kernel) == cv2.erode(label, kernel)
    return cv2.erode(flat.astype(np.uint8), kernel).astype(bool)


def _inside(pixels: Float64Array, camera: Camera) -> BoolArray:
    with np.errstate(invalid="ignore"):
        return ((pixels >= 0.0) & (pixels <= [camera.width_px - 1, camera.height_px - 1])).all(axis=1)


def _inverse_depth_at(images: CameraImages, pixels: Float64Array) -> Float64Array:
    """(N,) inverse depths, 1/m, of an image between its pixels."""
    assert images.depth is not None
    return cv2.remap(1.0 / images.depth, pixels.astype(np.float32), None, cv2.INTER_LINEAR)[:, 0]


def test_lidar_points_lie_in_the_box_of_their_actor(blocks: Studio, roof_points: Table) -> None:
    points_map, checked = apply(map_from_sensor(ROOF.pose, blocks.state), xyz(roof_points)), 0
    actors = blocks.state.actors
    for actor in actors[np.isin(actors["id"], roof_points["object_id"])]:
        if actor["tag"] == Tag.RIDER:
            continue  # knees swing out of the box of the rest pose
        of_actor = roof_points["object_id"] == actor["id"]
        local = apply(inverse(map_from_actors(actor[None])[0]), points_map[of_actor])
        half = np.array([actor["length"], actor["width"]]) / 2 + 0.02
        assert (np.abs(local[:, :2]) <= half).all()
        assert (local[:, 2] >= -0.02).all() and (local[:, 2] <= actor["height"] + 0.02).all()
        assert (roof_points["tag"][of_actor] == actor["tag"]).all()
        checked += int(of_actor.sum())
    assert checked > 500


@each_camera
def test_lidar_points_project_to_the_pixels_that_show_them(
    blocks: Studio, images: list[CameraImages], rays: RayScene, index: int
) -> None:
    """Projection as users do it: by the camera model, including distortion."""
    camera = CAMERAS[index]
    points = _scan(ROOF.model_copy(update={"pose": camera.pose}), blocks, rays)
    optical = apply(inverse(SENSOR_FROM_OPTICAL), xyz(points))
    optical, points = optical[optical[:, 2] > 0.5], points[optical[:, 2] > 0.5]
    pixels = camera.model.project(optical)
    inside = _inside(pixels, camera)
    pixels, depth_m, tag = pixels[inside], optical[inside, 2], points["tag"][inside]
    column, row = np.round(pixels).astype(int).T
    chosen = _off_silhouettes(images[index])[row, column]
    assert chosen.sum() > 1000
    assert (images[index].semantic[row, column] == tag)[chosen].mean() >= 0.999
    assert (np.abs(_inverse_depth_at(images[index], pixels) * depth_m - 1.0) < 0.005)[chosen].mean() >= 0.999


@each_camera
def test_the_roof_lidar_agrees_with_depth_images_where_the_camera_sees_its_points(
    blocks: Studio, images: list[CameraImages], rays: RayScene, roof_points: Table, index: int
) -> None:
    camera = CAMERAS[index]
    map_from_optical = map_from_sensor(camera.pose, blocks.state) @ SENSOR_FROM_OPTICAL
    points_map = apply(map_from_sensor(ROOF.pose, blocks.state), xyz(roof_points))
    optical = apply(inverse(map_from_optical), points_map)
    ahead = np.flatnonzero(optical[:, 2] > 0.5)
    pixels = camera.model.project(optical[ahead])
    inside = _inside(pixels, camera)
    pixels, seen = pixels[inside], ahead[inside]
    from_camera_m = points_map[seen] - map_from_optical[:3, 3]
    far = np.linalg.norm(from_camera_m, axis=1)
    rays.update(blocks.state, blocks.origin_m, ROOF.range_m + 5.0, blocks.state.ego_ids)
    first = rays.cast(map_from_optical[None, :3, 3], from_camera_m / far[:, None]).range_m
    free = np.flatnonzero(np.abs(first - far) < 0.02)[:30_000]  # OpenCV's limit for one call
    assert len(free) > 1000
    depth_m = optical[seen[free], 2]
    assert np.median(np.abs(1.0 - _inverse_depth_at(images[index], pixels[free]) * depth_m) * depth_m) < 0.01


def test_box_classes_and_bev_classes_share_their_names() -> None:
    assert set(BOX_CLASSES) - set(BEV_CLASSES) == {"traffic_light", "traffic_sign"}
