"""Semantic, instance, depth and flow images of simulated towns agree with Embree rays through the pixels' centers.

The ground truth uses the exact meshes; the coarser meshes drawn for distant objects must be equivalent.
"""

from collections.abc import Sequence

import numpy as np
import pytest
from camera_truth import Agreement, Triangles, agreement, truth_of
from studio import EXACT, Studio, random_views

from simbev_ros.config.modalities import MODALITIES
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.simulation.render.frame import CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = pytest.mark.gl

FOV_RAD = float(np.radians(80.0))
SMALL = PinholeCamera.from_field_of_view(320, 180, FOV_RAD)
LENS = LensCamera(320, 180, 165.0, 160.0, 162.0, 85.0, distortion=(-0.25, 0.08, 0.001, -0.0005, -0.01))
FISHEYE = FisheyeCamera(320, 280, 95.0, 92.0, 155.0, 140.0, (0.02, -0.004, 0.001, 0.0), float(np.radians(97.0)))
LARGE = PinholeCamera.from_field_of_view(800, 450, FOV_RAD)
TOWNS = ("Town02", "Town03", "Town04", "Town07", "Town10HD")


def agreements(studio: Studio, views: Sequence[CameraView]) -> list[Agreement]:
    still = Triangles.of_static(studio.static, studio.origin_m)
    moving = Triangles.of_actors(studio.models, studio.state, studio.previous, studio.origin_m)
    states = (studio.state, studio.previous)
    return [
        agreement(images, truth_of(view, still, moving, states, studio.origin_m))
        for view, images in zip(views, studio.images(views), strict=True)
    ]


def check(found: Sequence[Agreement], jointed_px: int) -> None:
    """Checks every view separately, and the flow of wheels and limbs in all views together (there must be enough)."""
    for each in found:
        assert each.inner > 0.3
        assert each.depth >= 0.999
        assert each.semantic >= 0.999
        assert each.instance >= 0.999
        assert each.unseen < 0.5
        assert np.median(each.flow_px) < 0.02
        assert np.quantile(each.flow_px, 0.99) < 0.2
    error_px = np.concatenate([each.jointed_flow_px for each in found])
    assert len(error_px) > jointed_px
    assert np.median(error_px) < 0.02
    assert np.quantile(error_px, 0.99) < 0.2


def test_images_of_a_small_town_are_those_of_rays(blocks: Studio) -> None:
    check(agreements(blocks, random_views(blocks.state, SMALL, 4, 1)), 200)


def test_images_of_bare_trees_are_those_of_rays() -> None:
    winter = Studio("Blocks", 3, "winter")
    check(agreements(winter, random_views(winter.state, SMALL, 4, 1)), 200)


@pytest.mark.parametrize("camera", [LENS, FISHEYE])
def test_a_lens_that_distorts_shows_what_its_rays_hit(blocks: Studio, camera: PinholeCamera) -> None:
    """Images are resampled, hence accurate to a pixel only next to silhouettes and, in depth, next to edges."""
    for each in agreements(blocks, random_views(blocks.state, camera, 2, 1)):
        assert each.inner > 0.3
        assert each.labels >= 0.999
        assert each.depth >= 0.99
        assert np.median(each.flow_px) < 0.02
        assert np.quantile(each.flow_px, 0.99) < 0.2


@pytest.mark.slow
def test_the_quality_of_pictures_changes_no_label(blocks: Studio) -> None:
    [view] = random_views(blocks.state, SMALL, 1, 1)
    [medium] = blocks.images([view])
    renderer = Renderer(blocks.static, blocks.models, quality="low")
    colored = CameraView(view.camera, view.ego_from_sensor, MODALITIES)
    [low] = renderer.render([colored], RenderFrame(blocks.state, blocks.previous))
    renderer.close()
    for name in EXACT:
        assert getattr(low, name).tobytes() == getattr(medium, name).tobytes(), name


@pytest.mark.slow
@pytest.mark.parametrize("town", TOWNS)
def test_images_of_towns_are_those_of_rays(town: str) -> None:
    studio = Studio(town, 11)
    check(agreements(studio, random_views(studio.state, LARGE, 4, 11)), 1000)
