"""Blur and rolling shutter, against exposures and rows that are rendered one moment after the other."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from render_scene import NOON, car, front_pose, scene, world
from test_lens import BARREL

from simbev_ros.config.optics import Exposure, Optics, Shutter
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, inverse
from simbev_ros.foundation.types import AnyArray, Float64Array, Table
from simbev_ros.scene.interpolation import interpolate_actors
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.simulation.render import renderer as renderer_module
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.simulation.render.image_sensor import _light_by_gray
from simbev_ros.simulation.render.lighting.exposure import shutter_times
from simbev_ros.simulation.render.renderer import Renderer

FRAME_S = 0.05
EXPOSURE = Exposure(time_s=0.02, iso=100, f_number=32)
READOUT_S = 0.03
WIDE = PinholeCamera(640, 360, 480.0, 480.0, 320.0, 190.0)
SMALL = PinholeCamera(240, 135, 180.0, 180.0, 120.0, 70.0)
WIDE_BARREL = LensCamera(600, 338, 375.0, 392.0, 268.0, 178.0, BARREL.distortion)
LABELS = ("semantic", "instance", "depth")
CROSSING = {"id": 7, "x": 12.0, "y": 1.0, "yaw": 1.57}
MOTIONS: dict[str, tuple[dict[str, float], dict[str, float]]] = {
    "driving": ({"x": 0.75}, {}),
    "turning": ({"x": 0.25, "yaw": 0.03}, {}),
    "crossing": ({}, {"y": 0.75, "wheel": 2.5}),
}
"""Change of the ego and of another car per frame: 15 m/s, 0.6 rad/s, and 15 m/s."""


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    result = Renderer(scene(), [car()])
    yield result
    result.close()


@pytest.fixture
def ideal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Color images stay those of ideal cameras."""
    monkeypatch.setattr(renderer_module, "form_images", lambda view, images, amplification: images)


def frame(motion: str) -> RenderFrame:
    """A frame at which the ego and the other car are 50 ms on from where they were."""
    ego, other = MOTIONS[motion]
    before = {name: CROSSING.get(name, 0.0) - change for name, change in other.items()}
    then = world({"id": 1, **{name: -change for name, change in ego.items()}}, CROSSING | before)
    return RenderFrame(replace(world({"id": 1}, CROSSING), stamp_ns=round(1e9 * FRAME_S)), then)


def moment(frame: RenderFrame, time_s: float) -> WorldState:
    """The world some time after a frame, as its motion goes on."""
    assert frame.previous is not None
    actors: Table = interpolate_actors(frame.previous.actors, frame.world.actors, 1.0 + time_s / FRAME_S)
    return replace(frame.world, actors=actors)


def taken(
    renderer: Renderer, frame: RenderFrame, camera: PinholeCamera, *modalities: Any, **shutter: float
) -> CameraImages:
    """Images of a camera; without a shutter, of one moment."""
    optics = (
        Optics(exposure=EXPOSURE)
        if not shutter
        else Optics.model_validate(
            {
                "exposure": EXPOSURE.model_copy(update={"time_s": shutter.pop("time_s", 1e-6)}),
                "imager": {"shutter": shutter},
            }
        )
    )
    return renderer.render([CameraView(camera, front_pose(), modalities, optics)], frame)[0]


def light(rgb: AnyArray | None) -> Float64Array:
    assert rgb is not None
    return _light_by_gray()[rgb].astype(np.float64)


@pytest.mark.gl
@pytest.mark.usefixtures("ideal")
@pytest.mark.parametrize(
    ("motion", "camera", "share"),
    [("driving", WIDE, 0.5), ("turning", WIDE, 0.5), ("crossing", WIDE, 0.65), ("turning", WIDE_BARREL, 0.6)],
)
def test_an_exposure_is_the_mean_light_of_its_moments(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch, motion: str, camera: PinholeCamera, share: float
) -> None:
    monkeypatch.setattr("simbev_ros.simulation.render.view.exposure_gain", lambda *_: 1.0)
    still, count = frame(motion), 24
    times_s = ((np.arange(count) + 0.5) / count - 0.5) * 0.02
    moments = [light(taken(renderer, RenderFrame(moment(still, time_s)), camera, "rgb").rgb) for time_s in times_s]
    expected = np.mean(moments, axis=0)
    sharp, blurred = (
        light(taken(renderer, still, camera, "rgb", **settings).rgb) for settings in ({}, {"time_s": 0.02, "iso": 100})
    )
    error, error_without = (np.sqrt(np.mean((image - expected) ** 2)) for image in (blurred, sharp))
    assert error < share * error_without, f"{error:.4f}, unblurred {error_without:.4f}"
    # Also where the background is at the stamp, next to what moves.
    instance = taken(renderer, still, camera, "instance").instance
    beside = (np.abs(sharp - expected).max(axis=2) > 0.1) & (instance == 0)
    assert beside.sum() > 50
    assert np.abs(blurred - expected)[beside].mean() < 0.7 * np.abs(sharp - expected)[beside].mean()


@pytest.mark.gl
@pytest.mark.parametrize(("motion", "camera"), [*((name, SMALL) for name in MOTIONS), ("turning", BARREL)])
def test_each_row_shows_its_own_moment(renderer: Renderer, motion: str, camera: PinholeCamera) -> None:
    middle = frame(motion)
    rows = []
    for row in range(camera.height_px):
        time_s = (row / (camera.height_px - 1) - 0.5) * READOUT_S
        images = taken(renderer, RenderFrame(moment(middle, time_s)), camera, *LABELS)
        rows.append([getattr(images, name)[row] for name in LABELS])
    expected = dict(zip(LABELS, map(np.stack, zip(*rows, strict=True)), strict=True))
    still, rolled = (
        taken(renderer, middle, camera, *LABELS, **settings) for settings in ({}, {"readout_s": READOUT_S})
    )
    for name in LABELS[:2]:
        equal, equal_without = (np.mean(getattr(images, name) == expected[name]) for images in (rolled, still))
        assert equal > 0.995 and 1.0 - equal <= max(0.5 * (1.0 - equal_without), 1e-3), (name, equal, equal_without)
    same = (rolled.instance == expected["instance"]) & (rolled.semantic == expected["semantic"])
    same &= np.isfinite(expected["depth"])
    assert rolled.depth is not None
    error = np.abs(rolled.depth[same] / expected["depth"][same] - 1.0)
    assert np.median(error) < 1e-4 and np.quantile(error, 0.98) < 0.005


@pytest.mark.gl
@pytest.mark.parametrize("camera", [SMALL, BARREL])
def test_flow_of_a_rolling_shutter_is_between_the_moments_of_both_rows(
    renderer: Renderer, camera: PinholeCamera
) -> None:
    now = frame("turning")
    assert now.previous is not None
    images = taken(renderer, now, camera, "depth", "flow", "instance", readout_s=READOUT_S)
    assert images.flow is not None and images.depth is not None
    rows, columns = np.mgrid[: camera.height_px, : camera.width_px]
    usable = np.isfinite(images.depth) & np.isfinite(images.flow[..., 0]) & (images.instance == 0)
    usable &= (rows % 7 == 0) & (columns % 7 == 0)
    pixels = np.stack([columns[usable], rows[usable]], axis=1)
    points = camera.rays(pixels) * images.depth[usable][:, None]

    def pose(time_s: float) -> Float64Array:
        ego = moment(now, time_s).ego.reshape(1)
        result: Float64Array = map_from_actors(ego)[0] @ front_pose() @ SENSOR_FROM_OPTICAL
        return result

    def row_s(row: float) -> float:
        return (row / (camera.height_px - 1) - 0.5) * READOUT_S

    errors_px = []
    for (column, row), point, flow in zip(pixels, points, images.flow[usable], strict=True):
        fixed, before = pose(row_s(row)) @ [*point, 1.0], np.array([column, row], float)
        for _ in range(6):
            there = inverse(pose(row_s(before[1]) - FRAME_S)) @ fixed
            before = camera.project(there[None, :3])[0]
        errors_px.append(np.linalg.norm([column, row] - before - flow))
    assert len(errors_px) > 50 and np.quantile(errors_px, 0.95) < 0.25


@pytest.mark.gl
@pytest.mark.parametrize("shutter", [{"readout_s": READOUT_S}, {"time_s": 0.02, "iso": 100}])
def test_without_motion_a_shutter_changes_nothing(renderer: Renderer, shutter: dict[str, float]) -> None:
    now = frame("driving").world
    for frames in (RenderFrame(now), RenderFrame(now, replace(now, stamp_ns=0))):
        without, images = (taken(renderer, frames, SMALL, *LABELS, **settings) for settings in ({}, dict(shutter)))
        for name in LABELS[:2]:
            assert np.mean(getattr(without, name) == getattr(images, name)) > 0.999


@pytest.mark.gl
@pytest.mark.usefixtures("ideal")
def test_drops_on_the_lens_are_drawn_last(renderer: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    sizes_px: list[tuple[int, int]] = []
    rain = renderer._shading.rain
    monkeypatch.setattr(rain, "draw_lens_drops", lambda image, copy, seed: sizes_px.append(image.size))
    taken(renderer, frame("turning"), SMALL, "rgb", readout_s=READOUT_S)
    assert sizes_px == [(SMALL.width_px, SMALL.height_px)]  # that of the ideal camera is larger


@pytest.mark.gl
@pytest.mark.slow
def test_computed_and_rasterized_shutters_are_the_same() -> None:
    both = []
    for use_compute in (False, True):
        drawing = Renderer(scene(), [car()], use_compute=use_compute)
        both.append(taken(drawing, frame("turning"), SMALL, "rgb", *LABELS, readout_s=READOUT_S, time_s=0.02))
        drawing.close()
    rasterized, computed = both
    assert rasterized.rgb is not None and computed.rgb is not None
    assert np.mean(rasterized.semantic != computed.semantic) < 2e-3
    assert np.abs(rasterized.rgb.astype(int) - computed.rgb).mean() < 0.5


def test_automatic_exposure_is_long_in_the_dark_and_then_amplifies() -> None:
    shutter, exposure = Shutter(max_time_s=0.02), Exposure(f_number=1.8)
    noon, night = (
        shutter_times(exposure, shutter, NOON.model_copy(update={"sun_altitude_deg": altitude}))
        for altitude in (60.0, -40.0)
    )
    assert 2e-5 < noon.exposure_s < 1e-4 and noon.amplification == 1.0  # f/1.8 by the rule of f/16
    assert night.exposure_s == 0.02 and 5.0 < night.amplification < 50.0
    fixed = shutter_times(Exposure(time_s=0.01, iso=800), shutter, NOON)
    assert (fixed.exposure_s, fixed.amplification) == (0.01, 4.0)


@pytest.mark.gl
def test_amplified_images_are_noisier(renderer: Renderer) -> None:
    noise = []
    for altitude in (50.0, -40.0):
        now = world({"id": 1}, weather=NOON.model_copy(update={"sun_altitude_deg": altitude}))
        optics = [Optics.model_validate({"imager": {"blur_px": 0.0, "shutter": shutter}}) for shutter in (None, {})]
        views = [CameraView(SMALL, front_pose(), ("raw",), each, noise_seed=5) for each in optics]
        without, amplified = (images.raw for images in renderer.render(views, RenderFrame(now)))
        assert without is not None and amplified is not None
        noise.append(np.abs(amplified.astype(int) - without).mean())
    assert noise[0] == 0.0 and noise[1] > 1.0
