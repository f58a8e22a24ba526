"""Raw images and the fall-off of light with an imager, as the renderer makes them."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from render_scene import car, front_pose, scene, world
from test_labels import MAP_OFFSET, pixel_rays

from simbev_ros.config.camera import Camera
from simbev_ros.config.optics import Optics
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.recording.arrays import image_array
from simbev_ros.recording.image_codecs import decode_image, encode_image
from simbev_ros.ros.msgs.images import image_message
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = pytest.mark.gl

PLAIN = PinholeCamera(320, 180, 200.0, 210.0, 142.3, 95.2)
BARREL = LensCamera(240, 136, 150.0, 157.0, 107.3, 71.2, (-0.28, 0.09, 0.002, -0.003, -0.012))
CLEAN = {"blur_px": 0.0, "glare": 0.0, "read_sigma_electrons": 0.0, "full_well_electrons": 1e7}
EGO = {"id": 1, "x": MAP_OFFSET[0], "y": MAP_OFFSET[1]}


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    return Renderer(scene(MAP_OFFSET), [car()])


def images(renderer: Renderer, camera: PinholeCamera, *modalities: str, **optics: object) -> CameraImages:
    view = CameraView(camera, front_pose(), modalities, Optics.model_validate(optics), noise_seed=3)  # type: ignore[arg-type]
    return renderer.render([view], RenderFrame(world(EGO)))[0]


def test_the_raw_image_is_what_the_color_image_of_its_tick_is_made_from(renderer: Renderer) -> None:
    both = images(renderer, PLAIN, "rgb", "raw", imager={"bits": 12})
    assert both.rgb is not None and both.raw is not None and both.raw.dtype == np.uint8
    light = cv2.demosaicing(both.raw, cv2.COLOR_BayerBG2RGB_EA) / 255.0
    developed = 255.0 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1.0 / 2.4) - 0.055)
    error = np.abs(developed - both.rgb)
    assert error.mean() < 2.5  # the steps of 8 bits of light are up to 13 gray levels in shadows
    assert np.abs(developed[..., ::-1] - both.rgb).mean() > 3.0 * error.mean()  # with red and blue swapped


def test_the_raw_image_is_the_same_without_the_color_image(renderer: Renderer) -> None:
    both, alone = images(renderer, PLAIN, "rgb", "raw", imager={}), images(renderer, PLAIN, "raw", imager={})
    assert alone.rgb is None and both.raw is not None and np.array_equal(both.raw, alone.raw)


@pytest.mark.parametrize("camera", [PLAIN, BARREL])
def test_an_imager_gets_light_that_falls_off_with_the_cosine_fourth_law(
    renderer: Renderer, camera: PinholeCamera
) -> None:
    even, darkened = (images(renderer, camera, "raw", imager=CLEAN, vignetting=exponent).raw for exponent in (0.0, 0.5))
    assert even is not None and darkened is not None
    cosine = (1.0 / np.linalg.norm(pixel_rays(camera), axis=1)).reshape(even.shape)
    usable = (even > 40) & (even < 250) & (darkened < 250)
    ratio = darkened[usable] / even[usable] / cosine[usable] ** 2  # metering makes all of it brighter by one factor
    assert cosine[usable].min() < 0.8
    assert np.quantile(np.abs(ratio / np.median(ratio) - 1.0), 0.99) < 0.03


def test_raw_images_pass_through_messages_and_bags() -> None:
    mosaic = np.arange(48, dtype=np.uint8).reshape(6, 8)
    message = image_message(mosaic, 0, "c", "bayer_rggb8")
    assert (message.encoding, message.step) == ("bayer_rggb8", 8)
    fields = {name: getattr(message, name) for name in ("height", "width", "step", "encoding", "is_bigendian")}
    assert np.array_equal(image_array(SimpleNamespace(**fields, data=np.array(message.data, np.uint8))), mosaic)
    png = encode_image("bayer_rggb8", mosaic)
    assert np.array_equal(decode_image("bayer_rggb8; png compressed", png), mosaic)


def test_only_an_imager_makes_raw_images() -> None:
    camera = {"type": "camera", "name": "a", "modalities": ["rgb", "raw"]}
    assert Camera.model_validate(camera | {"imager": {}}).modalities == ("rgb", "raw")
    with pytest.raises(ValueError, match="modalities: raw without imager"):
        Camera.model_validate(camera)
    assert "raw" not in Camera.model_validate({"type": "camera", "name": "a", "imager": {}}).modalities
