from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from point_distance import xyz
from scipy.integrate import quad
from synthetic_world import actor, box_model, mesh, sheet, static_scene, world

from simbev_ros.assets.materials import Material
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.scene.air import extinction_per_m, optical_depth
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors import lidar as lidar_module
from simbev_ros.simulation.sensors.lidar import LidarModel, LidarScan
from simbev_ros.simulation.sensors.lidar_weather import LidarWeather, drop_slope_per_m

MODELS = (box_model(Tag.CAR, (4.0, 2.0, 1.5)),)
CLEAR = world(actor(MODELS[0])).weather
GROUND = mesh(sheet([-300, -300], [300, 300]), Tag.ROAD, Material.ASPHALT)
WALL = mesh(sheet([-300, -300], [300, 300], z=22.0), Tag.WALL, Material.PLASTER)


def lidar(**properties: object) -> Lidar:
    quiet = {"drop_off": 0.0, "range_noise_sigma_m": 0.0, "channels": 32, "columns": 1024, "attenuation_per_m": 0.0}
    return Lidar.model_validate({"type": "lidar", "name": "top", "pose": Pose(z_m=2.0)} | quiet | properties)


def weather(**changes: float) -> Weather:
    return CLEAR.model_copy(update=changes)


def state(**changes: float) -> WorldState:
    base = world(actor(MODELS[0]))
    return WorldState(base.stamp_ns, base.tick, base.ego_id, base.actors, base.signals, weather(**changes))


def scan(sensor: Lidar, now: WorldState, above: bool = False) -> LidarScan:
    scene = RayScene(static_scene(WALL if above else GROUND), MODELS)
    scene.update(now, np.zeros(3), sensor.range_m + 10.0, now.ego_ids)
    return LidarModel(sensor, 3, 0.05).scan(scene, now)


def ranges_m(cloud: Table) -> Float64Array:
    return np.linalg.norm(xyz(cloud), axis=1)


def test_without_rain_and_fog_nothing_changes() -> None:
    with_effects, without = (scan(lidar(weather_effects=on), state(cloudiness=90.0)).points for on in (True, False))
    assert with_effects.tobytes() == without.tobytes()
    barely = scan(lidar(), state(fog_density=0.1)).points
    assert len(barely) == pytest.approx(len(without), rel=1e-4)


@pytest.mark.parametrize("rolling", [False, True])
def test_blocks_and_threads_change_nothing(rolling: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lidar_module, "_MIN_RAYS_PER_BLOCK", 1000)
    sensor = lidar(
        rolling=rolling, drop_off=0.3, drop_off_at_zero_intensity=0.4, range_noise_sigma_m=0.02, attenuation_per_m=0.01
    )
    for now in (state(), state(fog_density=60.0, precipitation=40.0)):
        scene = RayScene(static_scene(GROUND), MODELS)
        scene.update(now, np.zeros(3), sensor.range_m + 10.0, now.ego_ids)
        alone = LidarModel(sensor, 3, 0.05).scan(scene, now)
        with ThreadPoolExecutor(3) as threads:
            shared = LidarModel(sensor, 3, 0.05, max_blocks=7).start_scan(scene, now, (), threads).result()
        assert alone.points is not None and len(alone.points) > 1000
        assert shared.points.tobytes() == alone.points.tobytes()
        assert shared.semantic_points.tobytes() == alone.semantic_points.tobytes()


def test_semantic_points_ignore_the_weather() -> None:
    clear, foggy = (
        scan(lidar(), state(fog_density=density, precipitation=density)).semantic_points for density in (0, 100)
    )
    assert clear.tobytes() == foggy.tobytes()


@pytest.mark.parametrize("falloff", [0.0, 0.2, 5.0])
def test_optical_depth_is_the_integral_of_the_extinction(falloff: float) -> None:
    sky = weather(fog_density=70.0, fog_distance_m=15.0, fog_falloff=falloff, precipitation=60.0)
    start_m, end_m, range_m = 5.0, 40.0, 80.0

    def extinction(along_m: float) -> float:
        fog, rain = extinction_per_m(sky, start_m + (end_m - start_m) * along_m / range_m)
        return fog * (along_m > 15.0) + rain

    expected = quad(extinction, 0.0, range_m, points=[15.0])[0]
    found = optical_depth(sky, np.array([start_m]), np.array([end_m]), np.array([range_m]))
    assert found == pytest.approx([expected], rel=1e-4)


def test_fog_weakens_by_the_square_of_its_transmission() -> None:
    # A bright ceiling 20 m above: all its echoes are strong enough to be detected.
    sensor = lidar(channels=1, lower_fov_deg=60.0, upper_fov_deg=60.0)
    clear = scan(sensor, state(), above=True).points
    foggy = scan(sensor, state(fog_density=40.0, fog_falloff=0.0), above=True).points
    far = ranges_m(foggy) > 20.0
    assert far.mean() > 0.9
    depth = np.log(2.0) * 0.06 * 0.4**2 * 20.0 / np.sin(np.pi / 3)
    assert foggy["intensity"][far] / clear["intensity"][0] == pytest.approx(
        np.full(far.sum(), np.exp(-2.0 * depth)), rel=1e-3
    )


def test_denser_fog_loses_more_targets_and_gives_more_echoes_near_the_sensor() -> None:
    lost, near = [], []
    truth = len(scan(lidar(), state()).points)
    for density in (40.0, 70.0, 100.0):
        cloud = scan(lidar(), state(fog_density=density)).points
        is_air_echo = cloud["z"] > -1.999
        lost.append(1.0 - (len(cloud) - is_air_echo.sum()) / truth)
        near.append(is_air_echo.sum() / (32 * 1024))
        assert np.median(ranges_m(cloud)[is_air_echo]) < 10.0
    assert 0.0 <= lost[0] < lost[1] < lost[2] < 1.0
    assert near[0] < near[1] < near[2]
    assert near[2] > 0.2


def test_fog_gives_no_echoes_before_the_distance_where_it_begins() -> None:
    cloud = scan(lidar(), state(fog_density=100.0, fog_distance_m=30.0)).points
    is_air_echo = cloud["z"] > -1.999
    assert is_air_echo.any()
    assert ranges_m(cloud)[is_air_echo].min() > 30.0


def test_rain_gives_a_few_echoes_of_drops_near_the_sensor() -> None:
    upward = lidar(lower_fov_deg=5.0, upper_fov_deg=40.0)
    shares = []
    for precipitation in (0.0, 30.0, 100.0):
        cloud = scan(upward, state(precipitation=precipitation)).points
        shares.append(len(cloud) / (32 * 1024))
        if len(cloud):
            assert np.quantile(ranges_m(cloud), 0.9) < 10.0
    assert shares[0] == 0.0
    assert 0.0 < shares[1] < shares[2] < 0.1


def test_drops_have_the_extinction_that_their_sizes_are_derived_from() -> None:
    slope = drop_slope_per_m(0.002)
    area = quad(lambda d: 2.0 * np.pi / 4.0 * d**2 * 8e6 * np.exp(-slope * d), 0.0, 0.05)[0]
    assert area == pytest.approx(0.002, rel=1e-6)
    assert 8.0 < (4.1e3 / slope) ** (1 / 0.21) < 25.0  # Λ = 4.1 R^-0.21 per mm: heavy rain, mm/h


def test_the_number_of_drop_echoes_follows_from_the_beams_volume() -> None:
    # The beam is so wide and drops are so dense that nearly every larger drop counts; expectation by plain integration.
    sensor, sky = lidar(range_m=100.0), weather(precipitation=100.0)
    count = 400_000
    echoes = LidarWeather(sensor, sky, 0.0).air_echoes(count, np.random.default_rng(0))
    _, rain = extinction_per_m(sky, 0.0)
    slope = drop_slope_per_m(rain)

    def per_m(r: float) -> float:
        beam = 3e-3 * r
        threshold = max(0.1 * (r / 100.0) ** 2, 1e-3)
        min_diameter = beam * np.sqrt(threshold / ((0.33 / 2.33) ** 2 * np.exp(-2.0 * rain * r)))
        # Drops wider than the beam fill it; where even these are too weak none are seen.
        return 8e6 / slope * np.exp(-slope * min_diameter) * np.pi / 4.0 * beam**2 * (min_diameter < beam)

    expected = 1.0 - np.exp(-quad(per_m, 1.0, 100.0, limit=200)[0])
    assert np.isfinite(echoes.range_m).mean() == pytest.approx(expected, rel=0.05)


def test_very_dense_fog_still_gives_finite_values() -> None:
    deep = state(fog_density=100.0, fog_falloff=1e4, precipitation=100.0)
    low = WorldState(deep.stamp_ns, deep.tick, deep.ego_id, deep.actors.copy(), deep.signals, deep.weather)
    low.actors["z"] = -50.0
    cloud = scan(lidar(range_m=500.0), low).points
    assert np.isfinite(cloud["x"]).all()
    assert np.isfinite(cloud["intensity"]).all()


def test_a_lidar_above_the_fog_gets_weaker_echoes_from_inside_it() -> None:
    clear, foggy = (
        scan(lidar(pose=Pose(z_m=18.0)), state(fog_density=density, fog_falloff=20.0)).points for density in (0, 100)
    )
    assert len(foggy) == pytest.approx(len(clear), rel=0.5)
    assert foggy["intensity"].mean() < 0.9 * clear["intensity"].mean()
