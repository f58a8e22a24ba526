from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from synthetic_world import EGO_ID, actor, box, box_model, mesh, world

from simbev_ros.assets.actors.actor_model import ActorModel, CoarserMesh
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import BOX_CLASSES, Tag
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, Table
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.schema.views import VIEW_DTYPE
from simbev_ros.simulation.annotation.visibility.views import ViewAnnotator, visibility
from simbev_ros.simulation.render.frame import CameraView
from simbev_ros.simulation.render.view import NEAR_M

SIZE_M = (4.0, 2.0, 1.5)
CAR = replace(box_model(Tag.CAR, SIZE_M), box_class="car")
RIDER = box_model(Tag.RIDER, SIZE_M)
CAMERA = PinholeCamera(160, 90, 110.0, 115.0, 71.3, 50.2)
BARREL = LensCamera(160, 90, 83.0, 80.0, 81.0, 42.5, distortion=(-0.25, 0.08, 0.001, -0.0005, -0.01))
FISHEYE = FisheyeCamera(160, 90, 47.0, 48.0, 81.0, 42.5, (0.02, -0.005, 0.001, 0.0), float(np.radians(97.0)))
ALMOST_IDEAL = LensCamera(160, 90, 110.0, 115.0, 71.3, 50.2, distortion=(1e-9, 0.0, 0.0, 0.0, 0.0))
POSE = matrices_from_xyz_rpy(np.array([1.0, 0.2, 1.6]), np.array([0.03, 0.05, 0.1]))
EMPTY_IMAGE = np.zeros((90, 160), np.uint16)
VISIBLE, AMODAL = ([f"{prefix}{side}" for side in ("left", "top", "right", "bottom")] for prefix in ("", "amodal_"))


def view(
    state: WorldState,
    image: AnyArray = EMPTY_IMAGE,
    camera: PinholeCamera = CAMERA,
    models: Sequence[ActorModel] = (CAR, RIDER),
) -> Table:
    """View table of one camera and all actors."""
    (table,) = ViewAnnotator(models).views(state, state.actors, [CameraView(camera, POSE, ())], [image])
    return table


def depths_m(state: WorldState, pixels: Float64Array, camera: PinholeCamera = CAMERA) -> Float64Array:
    """(N, P) depth at which rays through pixels enter each box-shaped actor, inf for misses (slab method)."""
    map_from_optical = map_from_actors(state.ego.reshape(1))[0] @ POSE @ SENSOR_FROM_OPTICAL
    entries = []
    for pose in map_from_actors(state.actors):
        actor_from_optical = inverse(pose) @ map_from_optical
        rays, eye_m = camera.rays(pixels) @ actor_from_optical[:3, :3].T, actor_from_optical[:3, 3]
        half_m = np.array(SIZE_M) / 2.0
        sides = np.stack([(side * half_m + [0.0, 0.0, half_m[2]] - eye_m) / rays for side in (-1, 1)])
        enters, leaves = sides.min(axis=0).max(axis=1), sides.max(axis=0).min(axis=1)
        entries.append(np.where((enters < leaves) & (enters >= NEAR_M), enters, np.inf))
    return np.array(entries)


def pixels(low: tuple[int, int], high: tuple[int, int]) -> Float64Array:
    """(rows, columns, 2) pixels of a rectangle from ``low`` up to, but excluding, ``high``."""
    return np.stack(np.meshgrid(*(np.arange(a, b) for a, b in zip(low, high, strict=True))), axis=-1).astype(float)


CANVAS, IMAGE = pixels((-160, -90), (320, 180)), pixels((0, 0), (160, 90))


def silhouettes(state: WorldState, grid: Float64Array, camera: PinholeCamera = CAMERA) -> dict[int, BoolArray]:
    """Actor id → mask of the grid's pixels that would show the actor alone."""
    hit = np.isfinite(depths_m(state, grid.reshape(-1, 2), camera)).reshape(-1, *grid.shape[:2])
    return dict(zip(state.actors["id"].tolist(), hit, strict=True))


def crowd(seed: int, count: int, spread_m: float, angles: tuple[float, float] = (-0.9, 1.1)) -> WorldState:
    """Boxes scattered around the camera, which is inside none of them."""
    rng = np.random.default_rng(seed)
    rows = [actor(CAR, x=50.0, y=-20.0, yaw=0.4)]
    while len(rows) <= count:
        distance_m, angle = rng.uniform(2.0, spread_m), rng.uniform(*angles)
        position_m = 50.0 + distance_m * np.cos(0.4 + angle), -20.0 + distance_m * np.sin(0.4 + angle)
        rotation = dict(zip(("roll", "pitch", "yaw"), rng.uniform(-0.4, [0.4, 0.4, 3.0]), strict=True))
        row = actor(CAR, id=100 + len(rows), x=position_m[0], y=position_m[1], z=rng.uniform(-1.5, 1.5), **rotation)
        eye_m = inverse(map_from_actors(row)[0]) @ map_from_actors(rows[0])[0] @ POSE[:, 3]
        if (np.abs(eye_m[:3] - [0.0, 0.0, SIZE_M[2] / 2.0]) > np.array(SIZE_M) / 2.0 + 0.05).any():
            rows.append(row)
    return world(*rows)


def test_columns_are_aligned_and_have_point_cloud_types() -> None:
    assert VIEW_DTYPE.fields is not None
    for kind, offset, *_ in VIEW_DTYPE.fields.values():
        assert kind.str[1:] in {"u1", "u2", "u4", "i4", "f4", "f8"}
        assert offset % kind.itemsize == 0


def check(state: WorldState) -> int:
    """Compare all objects with rays through the pixels of the canvas; returns the number of objects."""
    found = {int(row["id"]): row for row in view(state)}
    compared = len(found)
    for actor_id, canvas in silhouettes(state, CANVAS).items():
        image_px, canvas_px = int(canvas[90:180, 160:320].sum()), int(canvas.sum())
        if actor_id == EGO_ID or not image_px:
            assert actor_id not in found
            continue
        row = found.pop(actor_id)
        assert abs(int(row["alone_px"]) - image_px) <= 1 + image_px // 500
        assert row["truncation"] == pytest.approx(1.0 - image_px / canvas_px, abs=2.0 / canvas_px + 2e-3)
        assert row["visible_px"] == 0 and row["visibility"] == 0.0
        assert np.isnan([row[name] for name in VISIBLE]).all()
        rows, columns = np.nonzero(canvas)
        around = [columns.min() - 160.5, rows.min() - 90.5, columns.max() - 159.5, rows.max() - 89.5]
        assert canvas_px < 200 or [row[name] for name in AMODAL] == pytest.approx(around, abs=1.6)
    assert not found
    return compared


@pytest.mark.parametrize(
    ("seed", "spread_m"),
    [pytest.param(1, 60.0, marks=pytest.mark.slow), (2, 12.0), pytest.param(3, 5.0, marks=pytest.mark.slow)],
)
def test_silhouettes_agree_with_rays_through_all_pixels_of_the_canvas(seed: int, spread_m: float) -> None:
    assert check(crowd(seed, 30, spread_m)) > 10


def test_an_object_beside_the_camera_ends_at_the_near_plane() -> None:
    state = world(actor(CAR), actor(CAR, id=9, x=0.5, y=1.4, z=0.7), actor(CAR, id=10, x=1.2, y=-0.98, z=1.0))
    depth_m = depths_m(state, CANVAS.reshape(-1, 2))[state.actors["id"] != EGO_ID]
    assert (depth_m.min(axis=1) < NEAR_M + 1e-3).all()  # in view, though outside the image
    assert check(state) == 2


def test_occluded_pixels_are_not_counted_and_the_visible_box_encloses_the_rest() -> None:
    state = crowd(4, 40, 40.0)
    depth_m = depths_m(state, IMAGE.reshape(-1, 2))
    depth_m[state.actors["id"] == EGO_ID] = np.inf
    nearest = state.actors["id"][depth_m.argmin(axis=0)]
    image = np.where(np.isinf(depth_m.min(axis=0)), 0, nearest).astype(np.uint16).reshape(90, 160)
    image[:, :20] = 0  # hidden by something that is not an object
    found = view(state, image)
    hidden = 0
    for row in found:
        shown_px = np.argwhere(image == row["id"])
        assert row["visible_px"] == len(shown_px)
        alone_px = np.isfinite(depth_m[state.actors["id"] == row["id"]]).sum()
        if len(shown_px) == 0:
            hidden += 1
            continue
        assert row["visibility"] == pytest.approx(len(shown_px) / alone_px, abs=2.0 / alone_px)
        assert row["visibility"] <= 1.0
        (top, left), (bottom, right) = shown_px.min(axis=0) - 0.5, shown_px.max(axis=0) + 0.5
        assert [row[name] for name in VISIBLE] == [left, top, right, bottom]
    assert hidden > 0
    assert {0, *found["id"].tolist()} >= set(np.unique(image).tolist())


def test_the_amodal_box_encloses_the_projected_corners() -> None:
    state = world(actor(CAR), actor(CAR, id=9, x=8.0, y=6.0, yaw=0.3))
    (row,) = view(state)
    corners_m = box([0, 0, SIZE_M[2] / 2], SIZE_M).reshape(-1, 3)
    optical_from_actor = inverse(POSE @ SENSOR_FROM_OPTICAL) @ map_from_actors(state.actors)[1]
    corners_px = CAMERA.project(corners_m @ optical_from_actor[:3, :3].T + optical_from_actor[:3, 3])
    expected = [*corners_px.min(axis=0), *corners_px.max(axis=0)]
    assert expected[0] < -0.5  # outside the image
    assert [row[name] for name in AMODAL] == pytest.approx(expected, abs=1.0 / 256.0)


@pytest.mark.parametrize(
    ("camera", "spread_m", "angles"),
    [(BARREL, 15.0, (-0.9, 1.1)), (FISHEYE, 15.0, (-np.pi, np.pi)), (FISHEYE, 3.0, (-np.pi, np.pi))],
)
def test_a_lens_distorts_silhouettes_like_rays(
    camera: PinholeCamera, spread_m: float, angles: tuple[float, float]
) -> None:
    state = crowd(5, 60, spread_m, angles)
    found = {int(row["id"]): row for row in view(state, camera=camera)}
    compared = 0
    for actor_id, image in silhouettes(state, IMAGE, camera).items():
        if actor_id != EGO_ID and image.any():
            assert abs(int(found[actor_id]["alone_px"]) - image.sum()) <= 1 + image.sum() // 200
            rows, columns = np.nonzero(image)
            inner = [columns.min() - 0.5, rows.min() - 0.5, columns.max() + 0.5, rows.max() + 0.5]
            found_box = np.array([found[actor_id][name] for name in AMODAL])
            assert (found_box[:2] <= np.add(inner[:2], 0.6)).all() and (
                found_box[2:] >= np.subtract(inner[2:], 0.6)
            ).all()
            compared += 1
    assert compared > 10


@pytest.mark.parametrize("yaw", [1.57, 1.3, 0.2])
def test_an_object_right_behind_a_fisheye_counts_where_it_reaches_into_the_view(yaw: float) -> None:
    camera = FisheyeCamera(160, 90, 36.0, 36.0, 79.5, 44.5, (0.0,) * 4, float(np.radians(119.0)))
    state = world(actor(CAR), actor(CAR, id=9, x=-0.3 if yaw > 1.0 else -1.4, y=0.2, z=0.8, yaw=yaw))
    (row,) = view(state, camera=camera)
    image = silhouettes(state, IMAGE, camera)[9]
    assert image.any() and not image[42:47, 70:90].any()
    assert abs(int(row["alone_px"]) - image.sum()) <= 1 + image.sum() // 100


def test_a_lens_with_almost_no_distortion_agrees_with_an_ideal_camera() -> None:
    state = crowd(6, 60, 8.0)
    ideal, distorted = view(state), view(state, camera=ALMOST_IDEAL)
    assert list(ideal["id"]) == list(distorted["id"])
    assert np.abs(ideal["alone_px"].astype(int) - distorted["alone_px"]).max() <= 3
    assert distorted["truncation"] == pytest.approx(ideal["truncation"], abs=0.01)
    for name in AMODAL:
        assert distorted[name] == pytest.approx(ideal[name], abs=0.1)


def test_rows_are_requested_objects_with_a_class_but_never_the_ego() -> None:
    ahead = {"x": 9.0, "z": 0.0}
    rows = [actor(CAR), actor(RIDER, 1, id=3, **ahead), *(actor(CAR, id=each, **ahead) for each in (300, 4, 20))]
    state = world(*rows, actor(CAR, id=50, x=-9.0))
    boxes = np.array([(0x10001,), (300,), (4,), (3,), (50,), (EGO_ID,)], [("id", "<u4")])
    cameras = [CameraView(CAMERA, POSE, ()), CameraView(CAMERA, POSE @ np.diag([-1.0, -1.0, 1.0, 1.0]), ())]
    ahead_of, behind = ViewAnnotator((CAR, RIDER)).views(state, boxes, cameras, [EMPTY_IMAGE, EMPTY_IMAGE])
    assert list(ahead_of["id"]) == [4, 300]
    assert [BOX_CLASSES[each] for each in ahead_of["class"]] == ["car", "car"]
    assert list(behind["id"]) == [50]
    assert ViewAnnotator((CAR, RIDER)).views(state, boxes[:0], cameras[:1], [EMPTY_IMAGE])[0].dtype == VIEW_DTYPE


def test_visible_pixels_beside_the_silhouette_count_for_the_object() -> None:
    image = EMPTY_IMAGE.copy()
    state = world(actor(CAR), actor(CAR, id=9, x=12.0))
    (alone,) = view(state)
    image[silhouettes(state, IMAGE)[9]] = 9
    image[0, :7] = 9
    (row,) = view(state, image)
    assert row["alone_px"] == row["visible_px"] >= alone["alone_px"] + 6
    assert row["visibility"] == 1.0


def test_an_object_alone_is_drawn_with_the_cameras_level_of_detail() -> None:
    half = mesh(box([0, 0, SIZE_M[2] / 4], [SIZE_M[0], SIZE_M[1], SIZE_M[2] / 2]), Tag.CAR)
    model = replace(CAR, build_coarser=lambda: (CoarserMesh(half, 0.02),))
    near, far = (world(actor(CAR), actor(CAR, id=9, x=x)) for x in (10.0, 60.0))
    opened = world(actor(CAR), actor(CAR, id=9, x=60.0, doors=1))

    def share(state: WorldState) -> float:
        (coarser,), (exact,) = view(state, models=[model]), view(state)
        return float(coarser["alone_px"] / exact["alone_px"])

    assert share(near) == 1.0
    assert 0.4 < share(far) < 0.7
    assert share(opened) == 1.0


def test_visibility_sums_over_all_cameras() -> None:
    left, right = np.zeros(2, VIEW_DTYPE), np.zeros(1, VIEW_DTYPE)
    left["id"], left["visible_px"], left["alone_px"] = [4, 9], [30, 0], [60, 10]
    right["id"], right["visible_px"], right["alone_px"] = [4], [30], [40]
    found = visibility(np.array([9, 5, 4, 0x10001], np.uint32), [left, right])
    assert found.dtype == np.float32
    assert found == pytest.approx([0.0, np.nan, 0.6, np.nan], nan_ok=True)
    assert np.isnan(visibility(np.array([4], np.uint32), [])).all()
    assert len(visibility(np.zeros(0, np.uint32), [left])) == 0
