"""Visible, unoccluded and truncated pixels in views of simulated towns agree with Embree rays through every pixel.

Unoccluded objects are drawn with the level of detail that the camera chose, so those meshes are the ground truth here.
test_cameras_against_rays.py shows that they are equivalent to the exact ones.
"""

from dataclasses import replace

import numpy as np
import pytest
from camera_truth import Triangles, truth_of
from studio import Studio, random_views
from view_truth import Alone, Canvas

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.geometry.transforms import inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.types import Table
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.simulation.annotation.boxes.boxes import boxes_around_ego
from simbev_ros.simulation.annotation.visibility.views import ViewAnnotator
from simbev_ros.simulation.render.frame import CameraView
from simbev_ros.simulation.render.geometry.level_of_detail import LevelsOfDetail, bounding_spheres
from simbev_ros.simulation.render.view import View

pytestmark = pytest.mark.gl

FOV_RAD = float(np.radians(80.0))
SMALL = PinholeCamera.from_field_of_view(320, 180, FOV_RAD)
LARGE = PinholeCamera.from_field_of_view(800, 450, FOV_RAD)
FISHEYE = FisheyeCamera(640, 560, 190.0, 184.0, 310.0, 280.0, (0.02, -0.004, 0.001, 0.0), float(np.radians(97.0)))
LENS = LensCamera(640, 360, 330.0, 320.0, 324.0, 170.0, distortion=(-0.25, 0.08, 0.001, -0.0005, -0.01))
TOWNS = ("Town02", "Town03", "Town07", "Town10HD")
RADIUS_M = 150.0


def beside(state: WorldState, camera: PinholeCamera) -> CameraView:
    """View along the side of the nearest vehicle, so close that the near plane cuts it."""
    actors = state.actors[state.actors["wheel"] != 0.0]
    actors = actors[~np.isin(actors["id"], sorted(state.ego_ids)) & (actors["width"] > 1.5)]
    nearest = np.hypot(actors["x"] - state.ego["x"], actors["y"] - state.ego["y"]).argmin()
    actor = actors[nearest]
    position_m = np.array([-0.1 * actor["length"], 0.5 * actor["width"] + 0.2, 0.5 * actor["height"]])
    pose = map_from_actors(actor.reshape(1))[0] @ matrices_from_xyz_rpy(position_m, np.array([0.0, 0.0, -0.2]))
    return CameraView(camera, inverse(map_from_actors(state.ego.reshape(1))[0]) @ pose, ("instance",))


def as_drawn(studio: Studio, view: CameraView) -> tuple[tuple[ActorModel, ...], WorldState]:
    """One model per actor, with the mesh that the camera chooses for it."""
    actors = studio.state.actors.copy()
    spheres = bounding_spheres(actors, studio.origin_m)
    pixel_m = View.of_camera(view, studio.state, None, studio.origin_m)[0].pixel_m(*spheres)
    detail = LevelsOfDetail(studio.models)
    kinds = zip(actors["blueprint"].tolist(), detail.select_levels(actors, pixel_m).tolist(), strict=True)
    models = tuple(replace(studio.models[kind], mesh=detail.meshes[kind][level]) for kind, level in kinds)
    actors["blueprint"] = np.arange(len(actors))
    return models, replace(studio.state, actors=actors)


def check(studio: Studio, views: list[CameraView]) -> list[Table]:
    """Compare all objects in some views; returns the rows."""
    objects = boxes_around_ego(studio.state, RADIUS_M)
    images = [each.instance for each in studio.images(views)]
    found = ViewAnnotator(studio.models).views(studio.state, objects, views, images)  # type: ignore[arg-type]
    still = Triangles.of_static(studio.static, studio.origin_m)
    for view, rows in zip(views, found, strict=True):
        models, state = as_drawn(studio, view)
        moving, lens = Triangles.of_actors(models, state, state, studio.origin_m), view.camera in (LENS, FISHEYE)
        canvas, image = Canvas(view, state, 0 if lens else 1), Canvas(view, state, 0)
        truth = truth_of(view, still, moving, (state, state), studio.origin_m).instance
        by_id = {int(row["id"]): row for row in rows}
        for actor_id in objects["id"].tolist():
            if actor_id in by_id:
                agree(by_id[actor_id], canvas.alone(models, actor_id), int((truth == actor_id).sum()), lens)
            else:
                assert image.alone(models, actor_id).image_px <= 1
    return found


def agree(row: np.void, alone: Alone, visible_px: int, lens: bool) -> None:
    """Compare one row with the ground truth.

    Next to silhouettes, images of a distorting lens are accurate to a pixel only, and the ground truth has no canvas
    for it. test_views.py checks the distortion of silhouettes.
    """
    share, large_px = (0.05, 400) if lens else (0.01, 50)
    alone_px = max(alone.image_px, int(row["visible_px"])) if lens else alone.image_px
    assert abs(int(row["alone_px"]) - alone_px) <= max(2.0, 0.01 * alone_px)
    if alone.image_px < large_px:
        return
    assert abs(float(row["visibility"]) - visible_px / alone.image_px) <= max(share, 1.01 / alone.image_px)
    if not lens:
        assert float(row["truncation"]) == pytest.approx(1.0 - alone.image_px / alone.canvas_px, abs=0.005)
        around = np.add(alone.box_px, [-0.5, -0.5, 0.5, 0.5])
        found = [row[f"amodal_{side}"] for side in ("left", "top", "right", "bottom")]
        assert found == pytest.approx(around, abs=2.5)


def test_views_of_a_small_town_are_those_of_rays(blocks: Studio) -> None:
    rows = np.concatenate(check(blocks, [*random_views(blocks.state, SMALL, 2, 5), beside(blocks.state, SMALL)]))
    large = rows[rows["alone_px"] >= 50]
    assert ((large["visibility"] > 0.05) & (large["visibility"] < 0.95)).sum() >= 1
    assert ((large["truncation"] > 0.05) & (large["truncation"] < 0.95)).sum() >= 1


@pytest.mark.slow
@pytest.mark.parametrize("camera", [LENS, FISHEYE])
def test_views_through_a_lens_are_those_of_its_rays(blocks: Studio, camera: PinholeCamera) -> None:
    assert sum(map(len, check(blocks, random_views(blocks.state, camera, 3, 5)))) > 20


@pytest.mark.slow
@pytest.mark.parametrize("town", TOWNS)
def test_views_of_towns_are_those_of_rays(town: str) -> None:
    studio = Studio(town, 11)
    check(studio, [*random_views(studio.state, LARGE, 5, 7), beside(studio.state, LARGE)])
