from world_scenes import NOON, of_kind, run, scene

from simbev_ros.schema.scene.state import Light

NIGHT = NOON.model_copy(update={"sun_altitude_deg": -30.0, "sun_azimuth_deg": 350.0})


def test_the_world_gets_dark_and_drivers_switch_their_lights_on():
    spec = scene(vehicles=4, pedestrians=1, ticks=60, warm_up_ticks=10, final_weather=NIGHT)
    states = run(spec)
    assert [state.weather for state in states] == [spec.weather_at(state.tick) for state in states]
    assert (states[10].weather, states[-1].weather) == (NOON, NIGHT)
    low_beams = [of_kind(state.actors[None], "vehicle")["lights"] & Light.LOW_BEAM > 0 for state in states]
    assert [bool(is_lit.all()) for is_lit in low_beams] == [state.weather.needs_low_beam for state in states]
    assert not low_beams[0].any() and low_beams[-1].all()
