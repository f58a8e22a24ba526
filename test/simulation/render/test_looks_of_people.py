"""The surfaces of people have the colors of their looks in images."""

import numpy as np
import pytest
from render_scene import NOON, actors, box, scene

from simbev_ros.assets.actors.actor_model import ActorModel, Part
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.scene.looks import load_looks
from simbev_ros.schema.scene.state import SIGNAL_DTYPE, WorldState
from simbev_ros.simulation.render.frame import CameraView, RenderFrame
from simbev_ros.simulation.render.geometry import rigid_table
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = pytest.mark.gl

MATERIALS = (Material.CLOTH_TINTED, Material.CLOTH_SECOND, Material.HAIR, Material.LEATHER, Material.SKIN)
RED, GREEN, BLUE = 0xE01010, 0x10E010, 0x1010E0


def stack() -> ActorModel:
    """Five boxes of half a meter on top of each other, one of each material, the second part on top."""
    meshes = [
        box((-0.5, -0.5, 0.5 * k), (0.5, 0.5, 0.5 * k + 0.5), Tag.PEDESTRIAN, material, part=min(k, 1))
        for k, material in enumerate(MATERIALS)
    ]
    parts = (Part("body"), Part("rest", parent=0))
    return ActorModel("pedestrian.test", Tag.PEDESTRIAN, "pedestrian", Mesh.merge(meshes), (1.0, 1.0, 2.5), parts, 0.0)


@pytest.fixture
def bands(monkeypatch):
    """Function: (5, 3) mean color of each box of a person with colors, seen by a camera 6 m away."""

    def photograph(color, skin, hair, second, leather):
        looks = np.array([[skin, hair, second, leather]], np.uint32)
        monkeypatch.setattr(rigid_table, "looks_of", lambda actors: looks.repeat(len(actors), axis=0))
        table = actors({"id": 1, "z": -50.0}, {"id": 2, "x": 6.0, "color": color})
        table["tag"] = Tag.PEDESTRIAN
        world = WorldState(0, 0, 1, table, np.zeros(0, SIGNAL_DTYPE), NOON)
        camera = PinholeCamera.from_field_of_view(100, 100, np.radians(40.0))
        view = CameraView(camera, matrices_from_xyz_rpy(np.array([0.0, 0.0, 51.25]), np.zeros(3)), ("rgb",))
        renderer = Renderer(scene(), [stack()])
        (images,) = renderer.render([view], RenderFrame(world, None))
        renderer.close()
        rows = 50.0 - camera.fy_px * (0.25 + 0.5 * np.arange(5) - 1.25) / 5.5
        return np.array([images.rgb[int(row) - 2 : int(row) + 3, 45:55].mean(axis=(0, 1)) for row in rows])

    return photograph


def test_garments_hair_and_leather_have_their_own_colors(bands):
    seen = bands(color=RED, skin=BLUE, hair=BLUE, second=GREEN, leather=RED)
    assert seen.argmax(axis=1).tolist() == [0, 1, 2, 0, 2]


def test_skin_is_darker_by_its_tone(bands):
    tones = [load_looks().skin[tone - 1] for tone in (1, 5, 7, 10)]
    brightness = [bands(color=RED, skin=tone, hair=RED, second=RED, leather=RED)[4].mean() for tone in tones]
    assert brightness == sorted(brightness, reverse=True)
    assert brightness[0] > 2.0 * brightness[-1]
