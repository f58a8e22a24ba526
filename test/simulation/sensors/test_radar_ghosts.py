"""Ghosts of a metal ball beside a flat wall, whose places, speeds and powers are worked out by hand.

The radar is at the origin, the ball 20 m ahead, the wall 6 m to the left: the ball's image is at (20, 12).
"""

from collections.abc import Mapping

import numpy as np
import pytest
from synthetic_world import TICK_NS, actor, ball, box, cart_model, mesh, static_scene, world

from simbev_ros.assets.actors.actor_model import ActorModel, Part
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.config.radar import Radar
from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Table
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors.radar import RadarModel, scan_radars

RADIUS_M = 0.4
BALL = ActorModel(
    "ball", Tag.CAR, "", mesh(ball([0, 0, 1], RADIUS_M), Tag.CAR, Material.METAL), (0.8,) * 3, (Part("body"),), 0.0
)
MODELS = (cart_model(), BALL)
EGO_MPS, BALL_MPS = (3.0, 0.0), (-5.0, 6.0)

IMAGE_M = np.hypot(20.0, 12.0)
IMAGE_DEG = np.degrees(np.arctan2(12.0, 20.0))
# The image moves with (-5, -6), the radar with (3, 0): the rate of their distance, and its mean with that of the ball.
IMAGE_MPS = (-8.0 * 20.0 - 6.0 * 12.0) / IMAGE_M
HALF_M, HALF_MPS = (IMAGE_M + 20.0) / 2.0, (IMAGE_MPS - 8.0) / 2.0
PLACES: Mapping[str, tuple[float, float, float]] = {
    "ball": (20.0 - RADIUS_M / 2.0, 0.0, -8.0),
    "image": (IMAGE_M - RADIUS_M / 2.0, IMAGE_DEG, IMAGE_MPS),
    "half towards the ball": (HALF_M - RADIUS_M / 2.0, 0.0, HALF_MPS),
    "half towards the wall": (HALF_M - RADIUS_M / 2.0, IMAGE_DEG, HALF_MPS),
}
"""Range, azimuth in degrees and speed of the ball and its ghosts."""
CELL = 0.5, 2.0, 0.25


def radar(**properties: object) -> Radar:
    values: dict[str, object] = {
        "pose": Pose(z_m=1.0),
        "range_m": 60,
        "horizontal_fov_deg": 80,
        "vertical_fov_deg": 8,
        "points_per_second": 600_000,
        "ray_pattern": "even",
        "range_resolution_m": CELL[0],
        "azimuth_resolution_deg": CELL[1],
        "doppler_resolution_mps": CELL[2],
        "max_doppler_mps": 30.0,
        "detector": {"noise_dbsm": -60},
        "ghosts": True,
    }
    return Radar.model_validate({"type": "radar", "name": "front"} | values | properties)


def wall(material: Material, tag: Tag = Tag.WALL) -> Mesh:
    return mesh(box([15.0, 6.5, 2.0], [50.0, 1.0, 8.0]), tag, material)


def scan(sensor: Radar, *static: Mesh, tick: int = 0) -> Table:
    state = world(
        actor(MODELS[0], vx=EGO_MPS[0], vy=EGO_MPS[1]),
        actor(MODELS[1], blueprint=1, id=9, x=20.0, vx=BALL_MPS[0], vy=BALL_MPS[1]),
        tick=tick,
    )
    scene = RayScene(static_scene(*static), MODELS)
    scene.update(state, np.zeros(3), 90.0, state.ego_ids)
    return scan_radars([RadarModel(sensor, 5, TICK_NS * 1e-9)], scene, state, None)[0]


def at(cloud: Table, place: str) -> Table:
    """The targets within a cell of a place."""
    range_m, azimuth_deg, speed_mps = PLACES[place]
    found: Table = cloud[
        (np.abs(cloud["range"] - range_m) < CELL[0])
        & (np.abs(np.degrees(cloud["azimuth"]) - azimuth_deg) < CELL[1])
        & (np.abs(cloud["doppler_velocity"] - speed_mps) < CELL[2])
    ]
    return found


def mean_rcs_dbsm(place: str, *static: Mesh) -> float:
    """Mean over many scans, which averages the speckle; a scan may miss the target."""
    found = [at(scan(radar(), *static, tick=tick), place)["rcs"] for tick in range(30)]
    return float(10.0 * np.log10(np.mean([10.0 ** (rcs.max() / 10.0) if len(rcs) else 0.0 for rcs in found])))


@pytest.mark.parametrize("place", PLACES)
def test_the_ball_is_seen_at_its_place_its_image_and_halfway(place: str) -> None:
    assert len(at(scan(radar(), wall(Material.METAL)), place)) == 1
    assert len(at(scan(radar(ghosts=False), wall(Material.METAL)), place)) == (place == "ball")


def test_an_image_lies_behind_the_wall() -> None:
    [image] = at(scan(radar(), wall(Material.METAL)), "image")
    assert (image["x"], image["y"]) == pytest.approx((20.0, 12.0), abs=0.5)


@pytest.mark.parametrize(("material", "mirror_db"), [(Material.METAL, 0.0), (Material.SHOPFRONT, -7.0)])
def test_a_wall_takes_its_share_twice_from_an_image_and_once_from_what_is_halfway(
    material: Material, mirror_db: float
) -> None:
    own_dbsm = 10.0 * np.log10(np.pi * RADIUS_M**2)
    halfway_db = 40.0 * np.log10(HALF_M) - 20.0 * np.log10(IMAGE_M * 20.0)
    assert mean_rcs_dbsm("image", wall(material)) == pytest.approx(own_dbsm + 2.0 * mirror_db, abs=2.0)
    for place in ("half towards the ball", "half towards the wall"):
        expected = own_dbsm + mirror_db + halfway_db
        assert mean_rcs_dbsm(place, wall(material)) == pytest.approx(expected, abs=2.0)


def test_what_hides_the_ball_leaves_its_image_alone() -> None:
    screen = mesh(box([10.0, 0.0, 1.0], [0.1, 1.0, 2.0]), Tag.STATIC, Material.PLASTIC)
    cloud = scan(radar(), wall(Material.METAL), screen)
    assert [len(at(cloud, place)) for place in PLACES] == [0, 1, 0, 0]


@pytest.mark.parametrize(
    "other", [wall(Material.WOOD), wall(Material.METAL, Tag.STATIC)], ids=["wood", "an object that is not flat"]
)
def test_other_surfaces_are_no_mirrors(other: Mesh) -> None:
    cloud = scan(radar(), other)
    assert [len(at(cloud, place)) for place in PLACES] == [1, 0, 0, 0]
    assert cloud.tobytes() == scan(radar(ghosts=False), other).tobytes()


def test_ghosts_need_a_detector() -> None:
    with pytest.raises(ValueError, match="ghosts: need a detector"):
        radar(detector=None)
