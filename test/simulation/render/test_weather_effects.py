"""Fog, rain and wet roads: against integrals and geometry, and without effect in dry weather."""

from dataclasses import replace
from importlib.resources import files

import cv2
import moderngl
import numpy as np
import pytest
from render_scene import CAMERA, NOON, box, car, front_pose, plane, scene, world

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, Tile
from simbev_ros.config.modalities import MODALITIES
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.simulation.render.gl.context import open_context
from simbev_ros.simulation.render.lighting.light import SkyLight
from simbev_ros.simulation.render.renderer import Renderer
from simbev_ros.simulation.render.shading.rain import FALL_MPS

pytestmark = pytest.mark.gl

RAIN = {"cloudiness": 90.0, "precipitation": 100.0, "wetness": 80.0, "precipitation_deposits": 80.0}


def shader_fog_depth(paths_m: Float64Array, fog: dict[str, float]) -> Float64Array:
    """(N,) fog depth from shaders/include/air.glsl for (N, 3) heights of both ends and lengths of paths."""
    folder = files("simbev_ros.simulation.render").joinpath("shaders/include")
    parts = [folder.joinpath(f"{name}.glsl").read_text(encoding="utf-8") for name in ("light", "view", "air")]
    body = "\n".join(line for part in parts for line in part.splitlines() if not line.startswith("#include"))
    main = """uniform sampler2D ways; out float depth;
        vec3 way() { return texelFetch(ways, ivec2(gl_FragCoord.xy), 0).xyz; }
        void main() { depth = fog_depth(way().x, way().y, way().z); }"""
    context = open_context()
    corners = "vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0)"
    program = context.program(
        vertex_shader=f"#version 330\nvoid main() {{ gl_Position = vec4({corners}, 0.0, 1.0); }}",
        fragment_shader=f"#version 330\n{body}\n{main}",
    )
    weather = NOON.model_copy(update=fog)
    head = SkyLight.from_weather(weather).block_head(weather, 0, np.zeros(3), 1.0)
    context.buffer(np.concatenate([head, np.zeros((12, 4))]).astype("f4").tobytes()).bind_to_uniform_block(1)
    program["Light"].binding = 1  # type: ignore[union-attr]
    context.texture((len(paths_m), 1), 3, paths_m.astype("f4").tobytes(), dtype="f4").use(0)
    target = context.framebuffer([context.texture((len(paths_m), 1), 1, dtype="f4")])
    target.use()
    context.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
    result = np.frombuffer(target.read(components=1, dtype="f4"), np.float32).astype(np.float64)
    context.release()
    return result


@pytest.mark.parametrize("falloff", [0.0, 0.2, 1.0, 5.0])
def test_fog_is_the_integral_of_its_density_along_the_path(falloff: float) -> None:
    paths_m = np.array([[1.6, 1.6, 80.0], [1.6, 0.0, 50.0], [1.6, 60.0, 200.0], [30.0, -5.0, 90.0], [2.0, 9.0, 15.0]])
    start_m = 20.0
    found = shader_fog_depth(paths_m, {"fog_density": 50.0, "fog_distance_m": start_m, "fog_falloff": falloff})
    for (low_m, high_m, range_m), depth in zip(paths_m, found, strict=True):
        along_m = np.linspace(min(start_m, range_m), range_m, 20001)
        density = 0.06 * 0.25 * np.exp2(-(low_m + (high_m - low_m) * along_m / range_m) * 0.02 * falloff)
        assert depth == pytest.approx(np.trapezoid(density, along_m), rel=2e-3, abs=1e-6)


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    """A dark plain."""
    ground = plane(300.0, 0.0, Tag.ROAD, Material.ASPHALT)
    return Renderer(StaticScene((Tile(np.zeros(3), ground, {}),), ()), [car()])


@pytest.mark.parametrize("speed_mps", [0.0, 4.0, 12.0])
def test_streaks_lean_with_the_cameras_speed(renderer: Renderer, speed_mps: float) -> None:
    camera = PinholeCamera.from_field_of_view(480, 360, 0.9)
    to_the_left = matrices_from_xyz_rpy(np.array([0.0, 0.0, 3.0]), np.array([0.0, 0.0, np.pi / 2]))
    weather = NOON.model_copy(update={"precipitation": 100.0})
    images = []
    for stamp_ns in (0, 70_000_000):
        state = replace(world({"id": 1, "vx": speed_mps}, weather=weather), stamp_ns=stamp_ns)
        [shot] = renderer.render([CameraView(camera, to_the_left, ("rgb",))], RenderFrame(state))
        assert shot.rgb is not None
        images.append(shot.rgb.astype(float).mean(axis=2))
    smooth = cv2.GaussianBlur(images[1] - images[0], (0, 0), 2.0)  # pixel edges are at 0 and 90 degrees
    down, right = np.gradient(smooth)
    lean_rad = 0.5 * np.arctan2(2.0 * (down * right).sum(), (right**2 - down**2).sum())
    assert np.tan(lean_rad) == pytest.approx(speed_mps / FALL_MPS.mean(), rel=0.12, abs=0.08)


def draw(renderer: Renderer, state: WorldState) -> CameraImages:
    [images] = renderer.render([CameraView(CAMERA, front_pose(), MODALITIES)], RenderFrame(state, state))
    return images


def test_rain_changes_only_the_color_image_and_leaves_no_trace() -> None:
    renderer = Renderer(scene(), [car()])
    dry, rainy, again = (
        draw(renderer, world({"id": 1}, {"id": 2, "x": 9.0}, weather=NOON.model_copy(update=more)))
        for more in ({}, RAIN, {})
    )
    renderer.close()
    for modality in MODALITIES:
        np.testing.assert_array_equal(getattr(dry, modality), getattr(again, modality))
        assert np.array_equal(
            getattr(dry, modality), getattr(rainy, modality), equal_nan=modality in ("flow", "depth")
        ) == (modality != "rgb")


def test_puddles_reflect_objects_behind_them() -> None:
    wall = box((20.0, -30.0, 0.0), (21.0, 30.0, 3.0), Tag.BUILDING)
    camera = PinholeCamera.from_field_of_view(320, 240, 1.0)
    pose = matrices_from_xyz_rpy(np.array([0.0, 0.0, 1.5]), np.array([0.0, 0.1, 0.0]))
    weather = NOON.model_copy(update={"cloudiness": 100.0, "precipitation_deposits": 100.0})
    below = []
    for pieces in ([], [wall]):
        tile = Tile(np.zeros(3), Mesh.merge([plane(300.0, 0.0, Tag.ROAD, Material.ASPHALT), *pieces]), {})
        renderer = Renderer(StaticScene((tile,), ()), [car()])
        [images] = renderer.render([CameraView(camera, pose, ("rgb",))], RenderFrame(world({"id": 1}, weather=weather)))
        renderer.close()
        assert images.rgb is not None
        below.append(images.rgb[120:140].astype(float).mean(axis=2))
    darker = below[0] - below[1]
    assert np.percentile(darker, 90) > 15.0, "the wall is darker than the sky"
