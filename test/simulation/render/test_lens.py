"""Lens and sensor: distorted pixels match their rays; exposure, vignetting and noise match their settings."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from render_scene import car, front_pose, scene, snap_error_m, world
from test_labels import EGO, MAP_OFFSET, OTHER, cast, map_from_optical, pixel_rays, triangles

from simbev_ros.config.camera import Camera
from simbev_ros.config.modalities import MODALITIES
from simbev_ros.config.optics import Exposure, Optics, SensorNoise
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera, ideal_camera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, apply, inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.simulation.render.frame import CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = pytest.mark.gl

BARREL = LensCamera(240, 135, 150.0, 157.0, 107.3, 71.2, (-0.28, 0.09, 0.002, -0.003, -0.012))
IDEAL = PinholeCamera(320, 180, 200.0, 210.0, 142.3, 95.2)
FISHEYE = FisheyeCamera(200, 160, 57.0, 59.0, 97.3, 82.2, (0.02, -0.005, 0.001, -0.0002), float(np.radians(97.0)))
PINCUSHION = LensCamera(240, 135, 195.0, 187.0, 124.0, 64.0, (0.2, 0.05, -0.002, 0.001, 0.01))


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    return Renderer(scene(MAP_OFFSET), [car()])


@pytest.mark.parametrize("camera", [BARREL, PINCUSHION, FISHEYE])
def test_labels_and_depth_agree_with_the_distorted_rays(renderer: Renderer, camera: PinholeCamera) -> None:
    now = world(EGO, OTHER)
    [images] = renderer.render([CameraView(camera, front_pose(), MODALITIES)], RenderFrame(now))
    assert images.semantic is not None and images.instance is not None and images.depth is not None
    corners, tags = triangles(now)
    pose = map_from_optical(now)
    rays = pixel_rays(camera) @ pose[:3, :3].T
    depth, triangle, _ = cast(pose[:3, 3] - MAP_OFFSET, rays, corners)
    shape = images.depth.shape
    nothing = np.where(np.isnan(rays[:, 0]), Tag.UNLABELED, Tag.SKY)
    semantic = np.where(np.isinf(depth), nothing, tags[triangle]).reshape(shape)
    is_car = (triangle >= len(tags) - len(car().mesh.triangle_tag)) & np.isfinite(depth)
    instance = np.where(is_car, 77, 0).reshape(shape)

    flat = _off_edges(semantic) & _off_edges(np.where(np.isinf(depth), -1, triangle).reshape(shape))
    agrees = (images.semantic == semantic) & (images.instance == instance)
    assert agrees[flat].mean() >= 0.999
    assert agrees.mean() > 0.985
    expected = depth.reshape(shape)
    assert np.isinf(images.depth[flat & np.isinf(expected)]).all()
    near = flat & agrees & (expected < 60.0)
    error_m = np.abs(images.depth[near] - expected[near])
    assert (error_m > 1e-3 + snap_error_m(camera, expected[near])).mean() < 5e-4


@pytest.mark.parametrize("camera", [BARREL, PINCUSHION, FISHEYE])
def test_flow_is_the_displacement_of_the_point_in_the_distorted_image(
    renderer: Renderer, camera: PinholeCamera
) -> None:
    now = world(EGO, OTHER)
    before = world({**EGO, "x": EGO["x"] - 0.7, "y": EGO["y"] + 0.1, "yaw": -0.03, "pitch": 0.01}, OTHER)
    view = CameraView(camera, front_pose(), ("depth", "flow"))
    [images] = renderer.render([view], RenderFrame(now, before))
    assert images.flow is not None and images.depth is not None and images.rgb is None
    then_from_now = inverse(map_from_optical(before)) @ map_from_optical(now)
    rays, depth = pixel_rays(camera), images.depth.reshape(-1, 1).astype(np.float64)
    sky = np.isinf(depth[:, 0])
    points = rays @ then_from_now[:3, :3].T  # directions for the sky
    points[~sky] = apply(then_from_now, (rays * np.where(sky[:, None], 1.0, depth))[~sky])
    rows, columns = np.mgrid[: camera.height_px, : camera.width_px]
    expected = np.stack([columns.ravel(), rows.ravel()], axis=1) - camera.project(points)
    flow = images.flow.reshape(-1, 2)
    seen = ~np.isnan(flow[:, 0])
    np.testing.assert_allclose(flow[seen], expected[seen], atol=5e-3)
    assert np.linalg.norm(flow[~sky & seen], axis=1).max() > 5.0
    size_px = np.array([camera.width_px, camera.height_px])
    before_px = np.stack([columns.ravel(), rows.ravel()], axis=1) - expected
    inside = np.all((before_px > -0.49) & (before_px < size_px - 0.51), axis=1)
    assert (
        0.9 < seen[inside].mean() < 1.0 and not seen[np.any((before_px < -0.51) | (before_px > size_px), axis=1)].any()
    )


@pytest.mark.parametrize("camera", [BARREL, PINCUSHION])
def test_the_color_image_agrees_with_the_ideal_image_distorted_by_opencv(
    renderer: Renderer, camera: LensCamera
) -> None:
    ideal = ideal_camera(camera)
    views = [CameraView(each, front_pose(), ("rgb",)) for each in (camera, ideal)]
    distorted, straight = (images.rgb for images in renderer.render(views, RenderFrame(world(EGO))))
    assert distorted is not None and straight is not None
    positions_px = ideal.project(pixel_rays(camera)).reshape(*distorted.shape[:2], 2).astype(np.float32)
    expected = cv2.remap(straight, positions_px, None, cv2.INTER_CUBIC).astype(float)
    error, shifted = (np.abs(distorted - np.roll(expected, step, axis=1)).mean() for step in (0, 1))
    assert error < 0.7 and shifted > 3.0 * error


@pytest.mark.parametrize("yaw_deg", [0, 40, -85, 100])
def test_the_colors_of_a_fisheye_are_those_of_ideal_cameras_in_any_direction(renderer: Renderer, yaw_deg: int) -> None:
    """The views to the sides look at seams between faces."""
    turn = matrices_from_xyz_rpy(np.zeros(3), np.array([0.0, 0.0, np.radians(yaw_deg)]))
    ideal = PinholeCamera.from_field_of_view(300, 300, float(np.radians(80.0)))
    views = [CameraView(FISHEYE, front_pose(), ("rgb",)), CameraView(ideal, front_pose() @ turn, ("rgb",))]
    round_view, straight = (images.rgb for images in renderer.render(views, RenderFrame(world(EGO))))
    assert round_view is not None and straight is not None
    optical_from_ideal = inverse(SENSOR_FROM_OPTICAL) @ turn @ SENSOR_FROM_OPTICAL
    rays = pixel_rays(FISHEYE) @ optical_from_ideal[:3, :3]
    pixels = ideal.project(np.where(rays[:, 2:] > 0.1, rays, [9.0, 9.0, 1.0])).reshape(*round_view.shape[:2], 2)
    seen = ((pixels > 2.0) & (pixels < 297.0)).all(axis=2)
    soft = cv2.GaussianBlur(straight, (0, 0), 1.0)
    expected = cv2.remap(soft, pixels.astype(np.float32), None, cv2.INTER_LINEAR).astype(float)
    error, shifted = (np.abs(round_view - np.roll(expected, step, axis=1))[seen].mean() for step in (0, 2))
    assert seen.sum() > 2500 and error < 3.5 and shifted > 4.0 * error


def test_equal_cameras_have_equal_images(renderer: Renderer) -> None:
    now = world(EGO, OTHER)
    views = [CameraView(camera, front_pose(), MODALITIES) for camera in (IDEAL, replace(IDEAL))]
    first, second = renderer.render(views, RenderFrame(now, now))
    for name in MODALITIES:
        if (image := getattr(first, name)) is not None:
            assert image.tobytes() == getattr(second, name).tobytes(), name


def test_outside_its_image_circle_a_fisheye_sees_nothing(renderer: Renderer) -> None:
    now = world(EGO, OTHER)
    weather = now.weather.model_copy(update={"precipitation": 90.0, "wetness": 90.0})
    now = replace(now, weather=weather)
    [images] = renderer.render([CameraView(FISHEYE, front_pose(), MODALITIES)], RenderFrame(now, now))
    outside = np.isnan(pixel_rays(FISHEYE)[:, 0]).reshape(160, 200)
    assert 0.05 < outside.mean() < 0.5
    assert images.rgb is not None and images.instance is not None and images.semantic is not None
    assert images.depth is not None and images.flow is not None
    assert not images.rgb[outside].any() and images.rgb[~outside].all(axis=1).mean() > 0.9
    assert not images.instance[outside].any() and np.array_equal(images.semantic == Tag.UNLABELED, outside)
    assert np.isposinf(images.depth[outside]).all() and np.isnan(images.flow[outside]).all()
    assert not np.isnan(images.flow[~outside]).any()


def _light(rgb: AnyArray) -> Float64Array:
    """Light before the tone mapping of Narkowicz (2015) with a gamma of 2.2."""
    light = np.linspace(0.0, 8.0, 80001)
    filmic = light * (2.51 * light + 0.03) / (light * (2.43 * light + 0.59) + 0.14)
    return np.interp(rgb / 255.0, np.minimum(filmic, 1.0) ** (1.0 / 2.2), light)


def _colors(renderer: Renderer, optics: Optics, camera: PinholeCamera = IDEAL, seed: int = 1) -> AnyArray:
    view = CameraView(camera, front_pose(), ("rgb",), optics, seed)
    [images] = renderer.render([view], RenderFrame(world(EGO)))
    assert images.rgb is not None
    return images.rgb


def test_one_stop_more_doubles_the_light(renderer: Renderer) -> None:
    dark, bright = (_colors(renderer, Optics(exposure=Exposure(compensation_ev=ev))) for ev in (-1.0, 0.0))
    usable = (dark > 40) & (bright < 230)
    ratio = _light(bright)[usable] / _light(dark)[usable]
    assert usable.mean() > 0.3 and np.median(ratio) == pytest.approx(2.0, rel=0.01)


def test_fixed_exposures_of_equal_value_agree_and_the_sunny_16_rule_holds(renderer: Renderer) -> None:
    sunny = _colors(renderer, Optics(exposure=Exposure(f_number=16, time_s=0.01, iso=100)))
    wide_open = _colors(renderer, Optics(exposure=Exposure(f_number=4, time_s=0.01 / 32, iso=200)))
    assert np.array_equal(sunny, wide_open)
    automatic = _colors(renderer, Optics(exposure=Exposure(f_number=4)))
    assert np.array_equal(automatic, _colors(renderer, Optics()))
    usable = (automatic > 40) & (automatic < 230)
    assert np.median(_light(sunny)[usable] / _light(automatic)[usable]) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("camera", [IDEAL, BARREL, FISHEYE])
def test_vignetting_follows_the_cosine_fourth_law_or_the_solid_angle(renderer: Renderer, camera: PinholeCamera) -> None:
    clear, darkened = (_colors(renderer, Optics(vignetting=strength), camera) for strength in (0.0, 0.5))
    rays = pixel_rays(camera)
    fourth = np.linalg.norm(rays, axis=1) ** -4.0
    share = camera.relative_illumination(rays) if isinstance(camera, FisheyeCamera) else fourth
    share = share.reshape(clear.shape[:2])
    usable = (clear.min(axis=2) > 60) & (clear.max(axis=2) < 235)
    ratio = (_light(darkened) / np.maximum(_light(clear), 1e-6)).mean(axis=2)
    error = ratio[usable] / share[usable] ** 0.5 - 1.0
    assert share[usable].min() < (0.7 if isinstance(camera, FisheyeCamera) else 0.41)
    assert np.abs(np.median(error)) < 0.005 and np.quantile(np.abs(error), 0.99) < 0.05


def test_noise_has_the_variance_of_its_electrons_and_no_pattern(renderer: Renderer) -> None:
    noise = SensorNoise(full_well_electrons=800, read_sigma_electrons=6)
    clear, noisy, other = (
        _colors(renderer, Optics(noise=n), seed=seed) for n, seed in ((None, 1), (noise, 1), (noise, 2))
    )
    light = _light(clear)
    errors = [_light(image) - light for image in (noisy, other)]
    for low, high in ((60, 90), (90, 130), (130, 180)):
        chosen = (clear >= low) & (clear < high)
        assert chosen.sum() > 5000
        expected = light[chosen] / 800 + (6 / 800) ** 2
        steps = ((_light(clear + 1.0) - _light(clear))[chosen] ** 2).mean() / 12.0
        assert errors[0][chosen].var() == pytest.approx(expected.mean() + steps, rel=0.05)
        assert abs(errors[0][chosen].mean()) < 4.0 * np.sqrt(expected.mean() / chosen.sum()) + 1e-3
    usable = ((clear > 60) & (clear < 180)).all(axis=2)
    red, green, blue = np.moveaxis(errors[0], 2, 0)
    pairs = [(red, green), (green, blue), (red, blue), (red, errors[1][..., 0])]
    pairs += [(red, np.roll(red, 1, axis)) for axis in (0, 1)]
    for first, second in pairs:
        assert abs(np.corrcoef(first[usable], second[usable])[0, 1]) < 0.03


@pytest.mark.parametrize("camera", [BARREL, FISHEYE])
def test_noise_is_reproducible_and_differs_between_seeds(renderer: Renderer, camera: PinholeCamera) -> None:
    optics = Optics(noise=SensorNoise())
    first, again, other = (_colors(renderer, optics, camera, seed) for seed in (7, 7, 7 + (1 << 40)))
    assert np.array_equal(first, again) and not np.array_equal(first, other)


def test_noise_differs_between_cameras_and_ticks() -> None:
    left, right = (Camera(type="camera", name=name) for name in ("left", "right"))
    seeds = [
        CameraView.from_config(camera, seed, tick).noise_seed
        for camera in (left, right)
        for seed in (0, 1)
        for tick in (0, 1)
    ]
    assert len(set(seeds)) == 8 and CameraView.from_config(left, 0, 0).noise_seed == seeds[0]


def _off_edges(image: AnyArray) -> AnyArray:
    """(H, W) pixels that are similar to their eight neighbors."""
    padded = np.pad(image, 1, mode="edge")
    rows, columns = image.shape
    windows = [padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)]
    flat: AnyArray = np.all([window == image for window in windows], axis=0)
    return flat
