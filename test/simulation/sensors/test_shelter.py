"""Lidars and radars of an ego in a tunnel are sheltered from rain and fog."""

from dataclasses import replace

import pytest
from analytic_maps import tunnel
from synthetic_world import actor, box_model, world

from simbev_ros.config.lidar import Lidar
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.simulation.sensors.lidar_weather import LidarWeather
from simbev_ros.simulation.sensors.radar_amplitude import rain_loss_db_per_m
from simbev_ros.simulation.sensors.shelter import with_local_weather

CAR = box_model(Tag.CAR, (4.0, 2.0, 1.5))


@pytest.mark.parametrize(("x_m", "z_m", "is_sheltered"), [(150.0, 0.0, False), (256.0, 0.0, True), (256.0, 9.0, False)])
def test_weather_is_clear_only_inside(x_m: float, z_m: float, is_sheltered: bool) -> None:
    state = world(actor(CAR, x=x_m, y=254.0, z=z_m))
    state = replace(state, weather=state.weather.model_copy(update={"precipitation": 80.0, "fog_density": 50.0}))
    weather = with_local_weather(state, Tunnels.of_layout(tunnel().layout)).weather
    assert LidarWeather(Lidar(type="lidar", name="lidar"), weather, 2.0).is_clear == is_sheltered
    assert (rain_loss_db_per_m(weather) == 0.0) == is_sheltered
