"""Rasterized and computed images are identical: in all weathers, by day and night, at every quality, with a lens."""

import numpy as np
import pytest
from render_scene import CAMERA, NOON, car, front_pose, scene, snap_error_m, vertex_snap_px, world

from simbev_ros.config.modalities import MODALITIES
from simbev_ros.config.optics import IDEAL_OPTICS
from simbev_ros.config.rendering import QUALITIES, Quality
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = [pytest.mark.gl, pytest.mark.slow]

NIGHT = {"sun_altitude_deg": -40.0}
WET = {"precipitation": 60.0, "precipitation_deposits": 80.0, "wetness": 90.0, "wind_intensity": 50.0}
FOG = {"fog_density": 60.0, "cloudiness": 90.0}
LENS = LensCamera(161, 91, 120.0, 120.0, 78.0, 44.0, distortion=(-0.2, 0.05, 0.001, -0.002, 0.0))
FISHEYE = FisheyeCamera(161, 121, 47.0, 48.0, 78.0, 61.0, (0.02, -0.005, 0.001, 0.0), 1.66)
ODD = PinholeCamera(161, 91, 110.0, 115.0, 71.3, 50.2)
"""Odd image size: low quality shades every second pixel."""
EGO = {"id": 1}
OTHER = {"id": 7, "x": 10.0, "y": -1.0, "yaw": 0.4, "lights": 0b1111}


def draw(quality: Quality, use_compute: bool, camera: PinholeCamera, changes: dict[str, float]) -> CameraImages:
    weather = NOON.model_copy(update=changes)
    before = world(EGO, OTHER, weather=weather)
    now = world({**EGO, "x": 0.5}, {**OTHER, "x": 10.4, "wheel": 0.3}, weather=weather)
    renderer = Renderer(scene(), [car()], quality=quality, use_compute=use_compute)
    view = CameraView(camera, front_pose(), MODALITIES, IDEAL_OPTICS)
    images = renderer.render([view], RenderFrame(now, before))[0]
    renderer.close()
    return images


@pytest.mark.parametrize(
    ("quality", "camera", "changes"),
    [
        ("high", CAMERA, {**WET, **FOG}),
        ("medium", LENS, NIGHT),
        ("medium", FISHEYE, WET),
        ("low", ODD, {}),
        *((quality, CAMERA, {}) for quality in QUALITIES),
        ("medium", CAMERA, {**NIGHT, **WET}),
        ("low", CAMERA, NIGHT),
    ],
)
def test_computed_images_equal_the_rasterized_ones(
    quality: Quality, camera: PinholeCamera, changes: dict[str, float]
) -> None:
    rasterized, computed = (draw(quality, use_compute, camera, changes) for use_compute in (False, True))
    assert np.mean(rasterized.semantic != computed.semantic) < 1e-3
    assert np.mean(rasterized.instance != computed.instance) < 1e-3
    np.testing.assert_array_equal(np.isinf(rasterized.depth), np.isinf(computed.depth))
    solid = np.isfinite(rasterized.depth) & (rasterized.semantic == computed.semantic)
    off_m = np.abs(computed.depth[solid] - rasterized.depth[solid])
    tolerance_m = 1e-4 * rasterized.depth[solid] + snap_error_m(camera, rasterized.depth[solid])
    assert np.mean(off_m > tolerance_m) < 5e-4 + vertex_snap_px()
    off_px = np.linalg.norm(computed.flow - rasterized.flow, axis=2)[solid]
    assert np.nanquantile(off_px, 0.99) < 0.01
    off = np.abs(computed.rgb.astype(int) - rasterized.rgb)
    assert off.mean() < 0.15
    assert rasterized.rgb.std() > 10.0
