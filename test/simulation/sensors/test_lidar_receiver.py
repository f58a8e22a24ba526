"""Lidars as they are sold, against physics by hand: power, incidence, panes, mirrors, edges, returns, intensity."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_world import actor, box, cart_model, mesh, static_scene, world

from simbev_ros.assets.materials import Material, load_materials
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.config.lidar import Lidar, Receiver
from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float32Array, Table
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors.lidar import LidarModel
from simbev_ros.simulation.sensors.lidar_beam import Echoes, edge_echoes
from simbev_ros.simulation.sensors.lidar_echo import surface_strength
from simbev_ros.simulation.sensors.lidar_receiver import LidarReceiver
from simbev_ros.simulation.sensors.lidar_window import find_windows

CART = cart_model()
R10_M = 80.0


def lidar(receiver: dict[str, object] | None = None, **properties: object) -> Lidar:
    """A lidar that looks ahead, level, without noise."""
    values: dict[str, object] = {
        "channels": 1,
        "columns": 81,
        "horizontal_fov_deg": 8.1,
        "lower_fov_deg": 0.0,
        "upper_fov_deg": 0.0,
        "drop_off": 0.0,
        "range_noise_sigma_m": 0.0,
        "beam_divergence_mrad": 0.01,
        "receiver": {"range_at_10_percent_m": R10_M, "spread_db": 0.0} | (receiver or {}),
    }
    return Lidar.model_validate({"type": "lidar", "name": "top", "pose": Pose(z_m=2.0)} | values | properties)


def points(sensor: Lidar, *meshes: Mesh, seed: int = 5, **weather: float) -> Table:
    state = world(actor(CART))
    state = replace(state, weather=state.weather.model_copy(update=weather))
    scene = RayScene(static_scene(*meshes), [CART])
    scene.update(state, np.zeros(3), sensor.range_m + 10.0, state.ego_ids)
    cloud = LidarModel(sensor, seed, 0.1).scan(scene, state).points
    assert cloud is not None
    return cloud


def wall(at_m: float, material: Material = Material.PLASTER, width_m: float = 40.0, left_m: float = 0.0) -> Mesh:
    """The near face of a wall across the x axis."""
    low, high = left_m - width_m / 2.0, left_m + width_m / 2.0
    corners = np.array([[at_m, low, 0.0], [at_m, high, 0.0], [at_m, high, 9.0], [at_m, low, 9.0]])
    return mesh(corners[[[0, 3, 2], [0, 2, 1]]], Tag.WALL, material)


def echoes(*rows: tuple[int, float, float]) -> Echoes:
    ray, range_m, strength = zip(*rows, strict=True)
    return Echoes(np.array(ray), np.array(range_m, np.float32), np.array(strength, np.float32))


def detect(receiver: LidarReceiver, given: Echoes, normal: Float32Array) -> tuple[Echoes, Float32Array]:
    """What a receiver returns of echoes, none of which is known to be the first of its beam."""
    none = np.zeros(len(normal), np.float32)
    return receiver.detect(Echoes(np.arange(len(normal)), none, none), given, normal)


def strength(material: Material, cos_angle: float, color: int = 0, wetness: float = 0.0) -> float:
    one = surface_strength(
        np.array([material], np.uint8), np.array([cos_angle], np.float32), np.array([color], np.uint32), wetness
    )
    return float(one[0])


@pytest.mark.parametrize("reflectance", [0.02, 0.1, 0.6])
def test_power_falls_with_the_square_of_the_range_up_to_the_threshold(reflectance: float) -> None:
    """Range equation: what is detected of reflectance r at R is 10 % at R sqrt(0.1 / r)."""
    receiver = LidarReceiver(lidar(range_m=500), Receiver(range_at_10_percent_m=R10_M, spread_db=0.0))
    limit_m = R10_M * np.sqrt(reflectance / 0.1)
    near, far = echoes((0, 0.99 * limit_m, reflectance)), echoes((0, 1.01 * limit_m, reflectance))
    zero = np.zeros(1, np.float32)
    assert len(detect(receiver, near, zero)[0].ray) == 1
    assert len(detect(receiver, far, zero)[0].ray) == 0
    assert detect(receiver, echoes((0, limit_m / 2.0, reflectance)), zero)[1] == pytest.approx([4.0])


@pytest.mark.parametrize("slant_deg", [0.0, 60.0, 80.0])
def test_a_slanted_surface_stretches_the_pulse(slant_deg: float) -> None:
    """A beam of 5 mrad at 20 m is 0.1 m wide; on a wall turned by 80° the spot is 0.57 m deep, for pulses of 0.75 m."""
    turn = np.radians(slant_deg)
    along = np.array([np.sin(turn), np.cos(turn), 0.0])
    corners = np.array([[20.0, 0, 0] - 15 * along, [20.0, 0, 0] + 15 * along])
    corners = np.concatenate([corners, np.add(corners[::-1], [0.0, 0.0, 9.0])])
    board = mesh(corners[[[0, 2, 1], [0, 3, 2]]], Tag.WALL, Material.CLOTH)
    level = {"white": 1.0, "steps": 65535}
    wide, narrow = (points(lidar(level, columns=1, beam_divergence_mrad=width), board) for width in (5.0, 0.01))
    expected = 1.0 / np.sqrt(1.0 + (0.1 * np.tan(turn) / 0.75) ** 2)
    assert wide["intensity"][0] / narrow["intensity"][0] == pytest.approx(expected, rel=1e-3)


def test_half_of_the_pulses_return_at_the_threshold_and_16_percent_one_standard_deviation_beyond() -> None:
    receiver = LidarReceiver(lidar(range_m=500), Receiver(range_at_10_percent_m=R10_M, spread_db=2.0))
    normal = np.random.default_rng(3).standard_normal(20_000).astype(np.float32)
    for beyond_db, share in ((0.0, 0.5), (2.0, 0.159)):
        range_m = R10_M * 10.0 ** (beyond_db / 20.0)
        rays = Echoes(np.arange(20_000), np.full(20_000, range_m, np.float32), np.full(20_000, 0.1, np.float32))
        assert len(detect(receiver, rays, normal)[0].ray) / 20_000 == pytest.approx(share, abs=0.015)


@pytest.mark.parametrize("material", [Material.ASPHALT, Material.PLASTER, Material.CLOTH])
def test_matte_surfaces_have_their_reflectance_from_ahead_and_more_than_lamberts_from_the_side(
    material: Material,
) -> None:
    table = load_materials()
    reflectance, lobe = float(table.lidar_reflectance[material]), 0.03
    assert strength(material, 1.0) == pytest.approx(reflectance, abs=lobe)
    assert strength(material, 0.05) > 2.0 * reflectance * 0.05
    # Oren and Nayar at 90°: B over A of the slopes' variance; the lobe vanishes there.
    variance = (0.6 * float(table.roughness[material])) ** 2
    expected = reflectance * 0.45 * variance / (variance + 0.09) / (1.0 - 0.5 * variance / (variance + 0.33))
    assert strength(material, 0.0) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("cos_angle", [0.0, 0.5, 1.0])
def test_leaves_are_as_bright_at_the_rim_of_a_crown_as_in_its_middle(cos_angle: float) -> None:
    reflectance = float(load_materials().lidar_reflectance[Material.FOLIAGE])
    assert strength(Material.FOLIAGE, cos_angle) == pytest.approx(reflectance * 2.0 / 3.0, abs=0.02)


def test_paint_shines_from_ahead_alone_and_dark_paint_is_dark() -> None:
    white, black = 0xFFFFFF, 0x000000
    assert strength(Material.CAR_PAINT, 1.0, black) > 1.0
    assert strength(Material.CAR_PAINT, 0.9, black) < 0.12
    assert strength(Material.CAR_PAINT, 0.9, white) > 5.0 * strength(Material.CAR_PAINT, 0.9, black)
    assert strength(Material.CAR_PAINT, 0.9, white, 1.0) == pytest.approx(
        0.7 * strength(Material.CAR_PAINT, 0.9, white), rel=0.1
    )


def test_wet_asphalt_gives_half() -> None:
    wet = points(lidar(), wall(10.0, Material.ASPHALT), wetness=100.0)
    dry = points(lidar(), wall(10.0, Material.ASPHALT))
    assert np.median(wet["intensity"]) == pytest.approx(0.55 * np.median(dry["intensity"]), rel=0.15)


def test_a_pane_lets_light_pass_twice() -> None:
    """Through a pane at 5 m, the wall at 12 m has (0.92 · 0.7)² of its power."""
    both = points(lidar(returns="last"), wall(5.0, Material.GLASS), wall(12.0))
    middle = both[np.abs(both["y"]) < 0.02]
    assert middle["x"] == pytest.approx(np.full(len(middle), 12.0), abs=0.02)
    passed = (0.92 * load_materials().lidar_transmission[Material.GLASS]) ** 2
    expected = passed * load_materials().lidar_reflectance[Material.PLASTER] * 100 / 255
    assert middle["intensity"] == pytest.approx(np.full(len(middle), expected), abs=0.005)


def test_what_a_pane_mirrors_seems_to_lie_behind_it() -> None:
    """A pane at 10 m, turned by 45°, mirrors a wall 6 m to its side: a ghost at 16 m."""
    pane = np.array([[8.0, 2.0, 0.0], [12.0, -2.0, 0.0], [12.0, -2.0, 9.0], [8.0, 2.0, 9.0]])
    side = np.array([[0.0, -6.0, 0.0], [30.0, -6.0, 0.0], [30.0, -6.0, 9.0], [0.0, -6.0, 9.0]])
    meshes = [
        mesh(corners[[[0, 2, 1], [0, 3, 2]]], Tag.WALL, material)
        for corners, material in ((pane, Material.OFFICE_GLASS), (side, Material.PLATE))
    ]
    cloud = points(lidar({"range_at_10_percent_m": 200.0}, returns="last", columns=81), *meshes)
    middle = cloud[np.abs(cloud["y"]) < 0.03]
    assert len(middle) >= 1
    assert middle["x"] == pytest.approx(np.full(len(middle), 16.0), abs=0.1)


def facade(at_m: float) -> Mesh:
    """A wall across the x axis whose bays of 3 m begin at y = -30, -27, …, seen 2 m above its ground."""
    corners = np.array([[at_m, -30, 0.0], [at_m, 30, 0.0], [at_m, 30, 9.0], [at_m, -30, 9.0]])[[[0, 3, 2], [0, 2, 1]]]
    uv = corners[..., 1:] + [30.0, 0.0]
    return Mesh.flat(corners, material=Material.FACADE, tag=Tag.WALL, color=(9, 9, 9), uv=uv)


def test_windows_return_light_from_curtains_behind_the_wall_or_from_rooms() -> None:
    """Openings reach from 0.85 to 2.15 m of each bay; panes are 0.18 m deep, and pass half of the light in all."""
    cloud = points(lidar({"white": 1.0, "steps": 65535}, columns=1001, horizontal_fov_deg=100.0), facade(20.0))
    place = (cloud["y"] / cloud["x"] * 20.0) % 3.0
    bay = np.floor(cloud["y"] / cloud["x"] * 20.0 / 3.0)
    is_wall = (place < 0.8) | (place > 2.2)
    is_window = (place > 0.9) & (place < 2.1) & (np.abs(cloud["y"]) > 6.0)  # out of the way of what panes mirror
    assert cloud["x"][is_wall] == pytest.approx(np.full(is_wall.sum(), 20.0), abs=1e-3)
    depth_m = {each: cloud["x"][is_window & (bay == each)] - 20.0 for each in np.unique(bay[is_window])}
    assert all(np.ptp(each) < 0.05 for each in depth_m.values())
    means_m = np.array([each.mean() for each in depth_m.values()])
    is_curtain = np.abs(means_m - 0.18) < 2e-3
    assert 0.3 < is_curtain.mean() < 0.9
    assert (means_m[~is_curtain] > 0.18).all()
    curtained = is_window & np.isin(bay, np.array(list(depth_m))[is_curtain])
    cos_angle = cloud["x"] / np.hypot(cloud["x"], cloud["y"])
    expected = (0.08 + 0.7**2 * 0.4) * cos_angle[curtained]
    assert cloud["intensity"][curtained] == pytest.approx(expected, rel=0.1)


def test_actors_ahead_of_a_facade_have_no_windows() -> None:
    cart = world(actor(CART, id=7, x=12.0, y=1.5))
    scene = RayScene(static_scene(facade(20.0)), [CART])
    scene.update(cart, np.zeros(3), 60.0)
    hits = scene.cast(np.array([[0.0, 1.5, 1.0]]), np.array([[1.0, 0.0, 0.0]], np.float32))
    assert hits.row[0] >= 0
    assert not len(find_windows(scene, hits).ray)


def test_an_edge_gives_a_beam_two_echoes_by_area() -> None:
    """Beams as wide as their spacing: over many edges, each side has its share, and close sides are one point."""
    posts = [wall(10.0, width_m=0.05, left_m=left_m) for left_m in np.arange(-0.6, 0.61, 0.1)]
    wide = lidar(columns=162, beam_divergence_mrad=1.5, returns="dual")
    cloud, narrow = points(wide, *posts, wall(20.0)), points(lidar(columns=162), *posts, wall(20.0))
    near = cloud["x"] < 15.0
    assert len(cloud) > 1.1 * len(narrow)
    assert cloud["intensity"][near].min() < 0.6 * narrow["intensity"].max()
    hanging = [
        np.sum((cloud["x"] > 10.05) & (cloud["x"] < 10.45))
        for cloud in (points(sensor, *posts, wall(10.5)) for sensor in (wide, lidar(columns=162)))
    ]
    assert hanging[0] > 5 > 2 * hanging[1]


@pytest.mark.parametrize(
    ("returns", "ranges_m"),
    [("strongest", [10.0, 30.0, 8.0]), ("last", [20.0, 30.0, 12.0]), ("dual", [10.0, 20.0, 5.0, 30.0, 8.0, 12.0])],
)
def test_which_echoes_return(returns: str, ranges_m: list[float]) -> None:
    """Of the first beam the near echo is stronger, of the second the far one, the third has three."""
    sensor = lidar(returns=returns)
    assert sensor.receiver is not None
    receiver = LidarReceiver(sensor, sensor.receiver)
    given = echoes(
        (0, 20.0, 0.3), (0, 10.0, 0.3), (1, 5.0, 0.005), (1, 30.0, 0.8), (2, 5.0, 0.05), (2, 8.0, 0.5), (2, 12.0, 0.3)
    )
    found, _ = detect(receiver, given, np.zeros(3, np.float32))
    assert found.range_m.tolist() == ranges_m


def test_a_retroreflector_saturates_white_is_white_and_steps_are_the_products() -> None:
    receiver = LidarReceiver(lidar(), Receiver(range_at_10_percent_m=R10_M, white=0.4, steps=100))
    value = receiver.intensity(
        echoes((0, 10.0, 785.0), (1, 40.0, 785.0), (2, 10.0, 1.0), (3, 10.0, 0.1), (4, 10.0, 0.001))
    )
    assert value.tolist() == pytest.approx([1.0, 1.0, 0.4, 0.04, 0.0])
    decibel = Receiver(range_at_10_percent_m=R10_M, scale="decibel", white=0.5, per_db=0.02, reference_m=10.0)
    value = LidarReceiver(lidar(), decibel).intensity(echoes((0, 10.0, 1.0), (1, 20.0, 1.0), (2, 100.0, 0.05)))
    assert value == pytest.approx([0.5, 0.5 - 0.02 * 6.02, 0.0], abs=0.003)


@pytest.mark.parametrize(
    ("rise_db", "lost_share"), [(-10.0, 0.0), (0.0, 0.012), (5.0, 0.159), (8.0, 0.5), (12.0, 0.902)]
)
def test_pulses_are_lost_where_the_power_rises_faster_than_the_gain(rise_db: float, lost_share: float) -> None:
    """Every second column is stronger than the one before; those between are as much weaker."""
    settings = Receiver(range_at_10_percent_m=R10_M, gain_step_db=8.0)
    receiver = LidarReceiver(lidar(channels=1000, columns=60, lower_fov_deg=-1.0), settings)
    rays = Echoes(np.arange(60_000), np.full(60_000, 9.0, np.float32), np.ones(60_000, np.float32))
    ratio = np.tile(np.repeat([3.0, 3.0 * 10.0 ** (rise_db / 10.0)], 1000), 30).astype(np.float32)
    kept = receiver.keeps(rays, ratio, np.random.default_rng(1).random(60_000, np.float32)).reshape(60, 1000)
    assert kept[0].all()
    assert 1.0 - kept[1::2].mean() == pytest.approx(lost_share, abs=0.01)


def test_below_its_floor_the_lidar_writes_0() -> None:
    """As an HDL-64E does, whose echoes without a measurable peak have intensity 0: 5 % at the floor, nothing below."""
    settings = Receiver(range_at_10_percent_m=R10_M, scale="decibel", white=0.5, per_db=0.05, steps=100, floor=0.05)
    value = LidarReceiver(lidar(), settings).intensity(echoes((0, 10.0, 0.13), (1, 10.0, 0.12), (2, 10.0, 0.01)))
    assert value.tolist() == pytest.approx([0.06, 0.0, 0.0], abs=0.006)


def test_near_by_the_receiver_sees_less_of_its_beam() -> None:
    receiver = LidarReceiver(lidar(), Receiver(range_at_10_percent_m=R10_M, near_field_m=3.0, white=1.0, steps=65535))
    value: Float32Array = receiver.intensity(echoes((0, 1.0, 0.5), (1, 3.0, 0.5), (2, 30.0, 0.5)))
    assert value == pytest.approx([0.5 * (1 - np.exp(-1 / 9)), 0.5 * (1 - np.exp(-1)), 0.5], abs=1e-3)


def test_channels_differ_by_a_gain_of_their_own_that_stays() -> None:
    sensor = lidar(channels=64, lower_fov_deg=-5.0)
    settings = Receiver(range_at_10_percent_m=R10_M, spread_db=0.0, channel_spread_db=2.0)
    rays = Echoes(np.arange(640), np.full(640, 10.0, np.float32), np.full(640, 0.3, np.float32))
    found, _ = detect(LidarReceiver(sensor, settings), rays, np.zeros(640, np.float32))
    gain_db = 10.0 * np.log10(found.strength / 0.3).reshape(10, 64)
    assert np.ptp(gain_db, axis=0).max() == 0.0
    assert gain_db[0].std() == pytest.approx(2.0, rel=0.4)
    assert gain_db[0].max() <= 2.0 + 1e-4


def test_weak_echoes_are_noisier() -> None:
    receiver = LidarReceiver(
        lidar(range_noise_sigma_m=0.005), Receiver(range_at_10_percent_m=R10_M, noise_at_threshold_m=0.03)
    )
    normal = np.ones(2, np.float32)
    measured_m = receiver.measured_m(echoes((0, 10.0, 0.1), (1, 10.0, 0.1)), np.array([1.0, 100.0], np.float32), normal)
    assert measured_m - 10.0 == pytest.approx([np.hypot(0.005, 0.03), np.hypot(0.005, 0.003)], abs=1e-5)


def test_an_edge_shares_the_beam_that_reaches_it_and_an_edge_that_is_nowhere_none() -> None:
    """Beams of half the width of their spacing: the first one ends at the edge, the last two do not have any."""
    first = echoes((0, 10.0, 1.0), (1, 20.0, 0.4), (2, 20.0, 0.4), (3, 10.0, 1.0))
    left, others = edge_echoes(first, 1, 0.25, np.array([0.0, np.nan, np.nan, 0.5], np.float32))
    assert left.strength == pytest.approx([0.5, 0.4, 0.4, 1.0])
    assert (others.ray.tolist(), others.range_m.tolist()) == ([0], [20.0])
    assert others.strength == pytest.approx([0.2])


def test_clouds_do_not_depend_on_the_number_of_threads() -> None:
    """A post has an edge straight ahead, where two halves of a turn would meet."""
    sensor = lidar(channels=64, columns=2048, lower_fov_deg=-10.0, horizontal_fov_deg=360.0, beam_divergence_mrad=3.0)
    state = world(actor(CART))
    posts = [wall(10.0, width_m=0.1, left_m=left_m) for left_m in np.arange(-8.75, 9.0, 0.4)]
    scene = RayScene(static_scene(*posts, wall(20.0)), [CART])
    scene.update(state, np.zeros(3), sensor.range_m + 10.0, state.ego_ids)
    one, many = (LidarModel(sensor, 5, 0.1, max_blocks=blocks).scan(scene, state).points for blocks in (1, 8))
    assert np.array_equal(one, many)


def test_leaves_return_some_rays_from_inside_and_let_some_pass() -> None:
    crown = mesh(box([10.0, 0.0, 2.0], [4.0, 4.0, 4.0]), Tag.VEGETATION, Material.FOLIAGE)
    cloud = points(lidar(columns=2000, returns="last"), crown, wall(30.0))
    inside, behind = (cloud["x"] > 8.05) & (cloud["x"] < 12.5), cloud["x"] > 29.0
    assert 0.2 < inside.mean() < 0.9
    assert 0.05 < behind.mean() < 0.8
