"""docs/extending: weather-parameter.md, object-class.md and modality.md are followed in a copy of the package."""

from pathlib import Path

import pytest
from followed_page import FollowedPage

WEATHER = """
import numpy as np
from simbev_ros.config.weather import WeatherConfig
from simbev_ros.scene.air import extinction_per_m
from simbev_ros.scene.drawing.draw_weather import draw_weathers
from simbev_ros.schema.scene.weather import Weather

clear, final = draw_weathers(WeatherConfig(final={"dust": {"uniform": [20, 80]}}), 1, even_fog=False)
assert clear.dust == 0 and 20 <= final.dust <= 80
before = {name: value for name, value in clear.model_dump().items() if name != "dust"}
assert Weather.model_validate(before) == clear
dusty = clear.model_copy(update={"dust": 100.0, "fog_density": 0.0})
assert np.isclose(extinction_per_m(dusty, 0.0)[0], 0.02 * np.log(2))
assert clear.interpolate(dusty, 0.5).dust == 50 and dusty.sheltered().dust == 0
try:
    WeatherConfig(dust=101)
except ValueError as error:
    assert "0 to 100 is allowed" in str(error)
"""
CLASSES = """
import numpy as np
from simbev_ros.config.evaluation import Evaluation
from simbev_ros.assets.actors.shape import build_model, load_shape
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES, MOVING_CLASSES
from simbev_ros.scene.blueprints import blueprint_named, load_blueprints
from simbev_ros.schema.boxes import difficulty
from simbev_ros.schema.nuscenes import category_of_blueprint
from simbev_ros.schema.palette import bev_color, chart_color, class_color
from simbev_ros.scene.legend import legend
from simbev_ros.simulation.annotation.boxes.boxes import class_of_blueprint

assert (BOX_CLASSES.index("tram"), BEV_CLASSES.index("tram")) == (10, 14) and "tram" in MOVING_CLASSES
index = [blueprint.name for blueprint in load_blueprints()].index("vehicle.tram")
assert class_of_blueprint()[index] == 10 and legend()["box_classes"][10] == "tram"
assert difficulty(np.array([10, 10]), np.array([10.0, 90.0]), np.array([200, 200])).tolist() == [0, 2]
assert bev_color(np.array([1 << 14], np.uint16))[0].tolist() == list(class_color("tram")) == list(chart_color("tram"))
tram = blueprint_named("vehicle.tram")
assert np.allclose(np.ptp(build_model(tram, load_shape(tram.name)).mesh.bounds_m, axis=0), tram.size_m)
assert category_of_blueprint("vehicle.tram", "tram") == "vehicle.bus.bendy"
assert Evaluation(classes=["tram"]).classes == ("tram",)
"""
MODALITIES = """
import numpy as np
from render_scene import car, front_pose, scene, world
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.simulation.render.frame import CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer

renderer = Renderer(scene(), [car()])
lens = LensCamera(64, 48, 50.0, 52.0, 31.5, 22.5, (-0.1, 0.0, 0.0, 0.0, 0.0))
for camera in (PinholeCamera(64, 48, 50.0, 52.0, 31.5, 22.5), lens):
    view = CameraView(camera, front_pose(), ("depth", "distance"))
    [images] = renderer.render([view], RenderFrame(world({"id": 1})))
    rows, columns = np.mgrid[:48, :64]
    rays = camera.rays(np.stack([columns.ravel(), rows.ravel()], axis=1)).reshape(48, 64, 3)
    expected = images.depth * np.linalg.norm(rays / rays[..., 2:], axis=-1)
    assert images.distance.dtype == np.float32 and np.isfinite(expected).mean() > 0.3
    assert np.allclose(images.distance, expected, rtol=1e-5)
"""


def require(page: FollowedPage, code: str, helpers: str = "test/support") -> None:
    """Run code in the copy, which raises if something is not as it should be."""
    result = page.run("-c", f"import sys; sys.path.append({str(page.copy / helpers)!r})\n{code}")
    assert result.returncode == 0, result.stderr


def test_a_weather_parameter_is_a_row_a_line_and_where_it_acts(tmp_path: Path) -> None:
    page = FollowedPage("weather-parameter.md", tmp_path)
    page.follow(1, 3)
    checks = page.checks("step 2") | page.checks("step 4")
    files = sorted({check.partition("::")[0] for check in checks})
    assert page.failures(*files) == checks
    page.follow(2, 4)
    assert page.failures(*files) == set()
    require(page, WEATHER)
    page.require_lint()


@pytest.mark.slow
def test_a_class_of_objects_is_a_row_and_a_constant(tmp_path: Path) -> None:
    page = FollowedPage("object-class.md", tmp_path)
    page.follow(1, 3)
    checks = page.checks("step 2") | page.checks("step 5")
    files = sorted({check.partition("::")[0] for check in checks})
    assert page.failures(*files) == checks
    page.follow(2, 4, 5)
    assert page.failures(*files) == set()
    require(page, CLASSES)
    page.require_lint()


@pytest.mark.slow
def test_a_modality_is_a_row_and_what_computes_it(tmp_path: Path) -> None:
    page = FollowedPage("modality.md", tmp_path)
    page.follow(1, 2)
    checks = page.checks("step 3") | page.checks("step 4")
    assert page.failures("test/config/test_modalities.py") == checks
    page.follow(3, 4)
    assert page.failures("test/config/test_modalities.py", "test/ros/msgs/test_sensor_topics.py") == set()
    assert page.mypy_errors(*(file for file in page.files if file.endswith(".py"))) == set()
    page.require_lint()


@pytest.mark.gl
@pytest.mark.slow
def test_the_new_modality_is_drawn_with_and_without_a_lens(tmp_path: Path) -> None:
    page = FollowedPage("modality.md", tmp_path)
    page.follow()
    require(page, MODALITIES, "test/simulation/render")
