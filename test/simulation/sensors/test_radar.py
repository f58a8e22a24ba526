import numpy as np
import pytest
from point_distance import xyz
from scipy import stats
from synthetic_world import TICK_NS, actor, box, box_model, cart_model, mesh, sheet, static_scene, world

from simbev_ros.assets.materials import Material
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.config.load import load_scenario
from simbev_ros.config.radar import Radar
from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.geometry.transforms import apply
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.schema.points import RADAR_POINT_DTYPE
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors.mount import map_from_sensor
from simbev_ros.simulation.sensors.radar import RadarModel, scan_radars

MODELS = (cart_model(), box_model(Tag.TRUCK, (2.0, 6.0, 3.0), Material.METAL))
SCAN_S = TICK_NS * 1e-9
NOTHING = StaticScene((), ())
GROUND = static_scene(mesh(sheet([-300, -300], [300, 300]), Tag.ROAD, Material.ASPHALT))
SHELL_M = 30.0


def radar(**properties: object) -> Radar:
    defaults: dict[str, object] = {"pose": Pose(z_m=1.0), "vertical_fov_deg": 20.0}
    return Radar.model_validate({"type": "radar", "name": "front"} | defaults | properties)


def scan(
    sensor: Radar, static: StaticScene, state: WorldState, previous: WorldState | None = None, seed: int = 5
) -> Table:
    return scan_radars([RadarModel(sensor, seed, SCAN_S)], updated_scene(static, state), state, previous)[0]


def updated_scene(static: StaticScene, state: WorldState) -> RayScene:
    scene = RayScene(static, MODELS)
    scene.update(state, np.array([state.ego["x"], state.ego["y"], state.ego["z"]]), 130.0, state.ego_ids)
    return scene


def inside_a_box() -> StaticScene:
    """Walls all around: every ray returns."""
    return static_scene(mesh(box([0.0, 0.0, 0.0], [2 * SHELL_M] * 3), Tag.WALL, Material.CONCRETE))


def test_fields_are_those_of_radar_return_after_x_y_z() -> None:
    names = ("x", "y", "z", "range", "azimuth", "elevation", "doppler_velocity", "amplitude")
    assert RADAR_POINT_DTYPE.names == names
    assert [RADAR_POINT_DTYPE.fields[name][1] for name in names] == list(range(0, 32, 4))  # type: ignore[index]
    assert all(RADAR_POINT_DTYPE[name] == np.float32 for name in names)


def test_the_papers_four_radars_have_default_properties() -> None:
    radars = load_scenario("paper").rig.of_type(Radar)
    poses = {each.name: (each.pose.x_m, each.pose.y_m, each.pose.z_m, each.pose.yaw_deg) for each in radars}
    assert poses == {
        "radar_left": (0.0, 1.0, 0.6, 90.0),
        "radar_front": (2.4, 0.0, 0.6, 0.0),
        "radar_right": (0.0, -1.0, 0.6, -90.0),
        "radar_back": (-2.4, 0.0, 0.6, 180.0),
    }
    assert all(each == Radar(type="radar", name=each.name, pose=each.pose) for each in radars)
    assert (radars[0].range_m, radars[0].horizontal_fov_deg, radars[0].vertical_fov_deg) == (120.0, 100.0, 12.0)


def test_the_papers_radar_casts_2000_rays_a_frame_and_each_that_hits_is_a_detection() -> None:
    cloud = scan(radar(), inside_a_box(), world(actor(MODELS[0])))
    assert len(cloud) == 2000
    half = scan(radar(), static_scene(mesh(box([20, 300, 0], [1, 600, 90]), Tag.WALL)), world(actor(MODELS[0])))
    assert 0.45 < len(half) / 2000 < 0.55, "the wall is in the left half"
    assert (half["azimuth"] > 0).all() and (half["y"] > 0).all()


def test_range_and_angles_are_those_of_points_on_the_surfaces() -> None:
    mount = Pose(x_m=2.0, y_m=0.5, z_m=1.5, yaw_deg=30.0, pitch_deg=4.0, roll_deg=-3.0)
    state = world(actor(MODELS[0], x=3.0, yaw=0.4, pitch=0.02))
    cloud = scan(radar(pose=mount), inside_a_box(), state)
    points_map = apply(map_from_sensor(mount, state), xyz(cloud))
    assert np.abs(np.abs(points_map).max(axis=1) - SHELL_M).max() < 1e-4
    range_m, azimuth, elevation = (cloud[name].astype(float) for name in ("range", "azimuth", "elevation"))
    assert np.linalg.norm(xyz(cloud), axis=1) == pytest.approx(range_m, rel=1e-6)
    assert np.arctan2(cloud["y"], cloud["x"]) == pytest.approx(azimuth, abs=1e-6)
    assert np.arcsin(cloud["z"] / range_m) == pytest.approx(elevation, abs=1e-6)


def test_only_hits_within_range_are_detected_and_too_near_ones_occlude() -> None:
    cloud = scan(radar(range_m=40.0, min_range_m=25.0), GROUND, world(actor(MODELS[0])))
    assert 25.0 <= cloud["range"].min() < 27.0
    assert 37.0 < cloud["range"].max() <= 40.0
    near = static_scene(mesh(box([5.0, 0.0, 0.0], [0.1, 80.0, 80.0]), Tag.WALL))
    assert len(scan(radar(min_range_m=25.0), near, world(actor(MODELS[0])))) == 0


def test_rays_fill_the_cone_evenly_over_radius_and_angle_as_in_carla() -> None:
    sensor = radar(points_per_second=400_000, horizontal_fov_deg=100.0, vertical_fov_deg=12.0)
    x, left, up = RadarModel(sensor, 3, SCAN_S).directions(7).T
    left, up = left / x / np.tan(np.radians(50.0)), up / x / np.tan(np.radians(6.0))
    assert len(x) == 20_000
    assert stats.kstest(np.hypot(left, up), stats.uniform.cdf).pvalue > 0.01
    assert stats.kstest(np.arctan2(up, left) / (2 * np.pi) + 0.5, stats.uniform.cdf).pvalue > 0.01


def test_even_rays_fill_the_field_of_view_evenly_in_solid_angle() -> None:
    sensor = radar(points_per_second=400_000, ray_pattern="even", vertical_fov_deg=60.0)
    directions = RadarModel(sensor, 3, SCAN_S).directions(7)
    azimuth_deg = np.degrees(np.arctan2(directions[:, 1], directions[:, 0]))
    assert stats.kstest(azimuth_deg / 100.0 + 0.5, stats.uniform.cdf).pvalue > 0.01
    assert stats.kstest(directions[:, 2] + 0.5, stats.uniform.cdf).pvalue > 0.01, "sin 30° is a half"
    assert np.linalg.norm(directions, axis=1) == pytest.approx(np.ones(20_000))


def test_a_scan_repeats_for_a_tick_and_each_tick_and_radar_has_its_own_rays() -> None:
    noisy = {"range_noise_sigma_m": 0.1, "doppler_noise_sigma_mps": 0.1}
    scene, state = updated_scene(GROUND, world(actor(MODELS[0]), tick=3)), world(actor(MODELS[0]), tick=3)
    front, other = radar(**noisy), radar(name="other", **noisy)
    [first] = scan_radars([RadarModel(front, 5, SCAN_S)], scene, state, None)
    beside, again = scan_radars([RadarModel(other, 5, SCAN_S), RadarModel(front, 5, SCAN_S)], scene, state, None)
    assert first.tobytes() == again.tobytes(), "also among others"
    assert first.tobytes() != beside.tobytes()
    assert first.tobytes() != scan(front, GROUND, world(actor(MODELS[0]), tick=4)).tobytes()
    assert first.tobytes() != scan(front, GROUND, state, seed=6).tobytes()


def test_nothing_hit_gives_an_empty_cloud_without_warnings() -> None:
    state = world(actor(MODELS[0]))
    for options in ({}, {"range_noise_sigma_m": 1.0, "threshold_db": -50.0, "max_doppler_mps": 10.0}):
        cloud = scan(radar(**options), NOTHING, state)
        assert (len(cloud), cloud.dtype) == (0, RADAR_POINT_DTYPE)
    assert scan_radars([], updated_scene(NOTHING, state), state, None) == []


def test_values_are_finite_where_some_rays_hit_nothing() -> None:
    cloud = scan(radar(), GROUND, world(actor(MODELS[0]), actor(MODELS[1], 1, id=9, x=20.0, vx=3.0)))
    assert 200 < len(cloud) < 1900
    assert all(np.isfinite(cloud[name]).all() for name in cloud.dtype.names or ())


def range_rates_by_differences(sensor: Radar, state: WorldState, cloud: Table, row: Table | None) -> Float64Array:
    """Range rates of points fixed to an actor (None: to the map) as seen from the radar, by moving both a little."""
    distances_m = []
    for seconds in (-1e-4, 1e-4):
        moved_state = world(*(advance_row(each[None], seconds) for each in state.actors))
        radar_m = map_from_sensor(sensor.pose, moved_state)[:3, 3]
        points_m = apply(map_from_sensor(sensor.pose, state), xyz(cloud))
        if row is not None:
            local = apply(np.linalg.inv(map_from_actors(row)), points_m)
            points_m = apply(map_from_actors(advance_row(row[None], seconds)[0]), local)
        distances_m.append(np.linalg.norm(points_m - radar_m, axis=1))
    return (distances_m[1] - distances_m[0]) / 2e-4


def advance_row(row: Table, seconds: float) -> Table:
    """Move an actor by its velocity and, about the vertical, by its angular velocity; in double precision."""
    wide = np.dtype([(name, "f8" if row.dtype[name].kind == "f" else row.dtype[name].str) for name in row.dtype.names])
    row = row.astype(wide)
    for coordinate, rate in (("x", "vx"), ("y", "vy"), ("z", "vz"), ("yaw", "wz")):
        row[coordinate] += row[rate] * seconds
    return row


MOUNT = Pose(x_m=2.0, y_m=-0.8, z_m=1.0, yaw_deg=20.0)


@pytest.mark.parametrize(
    ("ego", "target"),
    [
        ({"vx": 12.0}, {}),
        ({}, {"vx": -7.0, "vy": 3.0}),
        ({"wz": 0.6, "vx": 8.0, "vy": 2.0}, {}),
        ({}, {"wz": 0.9}),
        ({"yaw": 0.3, "wz": -0.4, "vx": 9.0, "vz": 0.5}, {"vx": 4.0, "vy": -6.0, "wz": 0.7}),
    ],
    ids=["ego drives", "target drives", "ego turns", "target turns", "all"],
)
def test_doppler_is_the_rate_of_the_distance_to_the_hit_point(ego: dict[str, float], target: dict[str, float]) -> None:
    sensor = radar(pose=MOUNT)
    row = actor(MODELS[1], 1, id=9, x=15.0, y=4.0, yaw=0.5, **target)
    state = world(actor(MODELS[0], **ego), row)
    cloud = scan(sensor, GROUND, state)
    on_target = apply(map_from_sensor(MOUNT, state), xyz(cloud))[:, 2] > 0.01
    assert on_target.sum() > 200
    for chosen, carrier in ((cloud[on_target], row[0]), (cloud[~on_target], None)):
        expected_mps = range_rates_by_differences(sensor, state, chosen, carrier)
        assert chosen["doppler_velocity"] == pytest.approx(expected_mps, abs=2e-3)


def test_receding_is_positive_and_approaching_negative() -> None:
    for speed_mps in (10.0, -10.0):
        state = world(actor(MODELS[0]), actor(MODELS[1], 1, id=9, x=20.0, vx=speed_mps))
        cloud = scan(radar(horizontal_fov_deg=4.0, vertical_fov_deg=2.0), NOTHING, state)
        assert cloud["doppler_velocity"] == pytest.approx(np.full(len(cloud), speed_mps), rel=1e-3)


def test_a_rotating_side_recedes_at_one_end_and_approaches_at_the_other() -> None:
    state = world(actor(MODELS[0]), actor(MODELS[1], 1, id=9, x=20.0, wz=0.5))
    cloud = scan(radar(horizontal_fov_deg=20.0), NOTHING, state)
    # The point (19, y) turns about (20, 0) with the velocity 0.5 · (-y, -1).
    expected_mps = 0.5 * (-cloud["y"] * cloud["x"] - cloud["y"]) / cloud["range"]
    assert cloud["doppler_velocity"] == pytest.approx(expected_mps, abs=1e-4)
    assert np.abs(cloud["doppler_velocity"]).max() > 1.2


def test_wheels_have_their_own_speed_only_with_micro_doppler() -> None:
    speed_mps, wheel_radius_m = 6.0, 0.3
    turn_rad = speed_mps / wheel_radius_m * SCAN_S
    before = world(actor(MODELS[0]), actor(MODELS[0], id=9, x=8.0, vx=speed_mps))
    cart = actor(MODELS[0], id=9, x=8.0 + speed_mps * SCAN_S, vx=speed_mps, wheel=turn_rad)
    state = world(actor(MODELS[0]), cart, tick=1)
    low = {"pose": Pose(z_m=0.1), "horizontal_fov_deg": 30.0, "vertical_fov_deg": 20.0}
    plain = scan(radar(**low), NOTHING, state, before)
    micro = scan(radar(**low, micro_doppler=True), NOTHING, state, before)
    along = xyz(plain) / plain["range"][:, None]
    assert plain["doppler_velocity"] == pytest.approx(speed_mps * along[:, 0], abs=1e-4)
    on_wheel = np.abs(plain["y"]) > 0.799  # the body is between them
    assert 50 < on_wheel.sum() < len(plain)
    assert micro[~on_wheel].tobytes() == plain[~on_wheel].tobytes()
    # Rolling turns about the wheel's axis: forward above it, backward below.
    axis_x = np.where(plain["x"] < 8.3, 7.0, 9.6)
    above_m, ahead_m = plain["z"] + 0.1 - 0.4, plain["x"] - axis_x
    own_mps = speed_mps / wheel_radius_m * (above_m * along[:, 0] - ahead_m * along[:, 2])
    expected_mps = plain["doppler_velocity"] + own_mps
    assert micro["doppler_velocity"][on_wheel] == pytest.approx(expected_mps[on_wheel], abs=0.02)
    assert scan(radar(**low, micro_doppler=True), NOTHING, state).tobytes() == plain.tobytes(), "no tick before"
