"""Weather that commands change while a scene runs."""

import pytest
from made_up_scene import made_up_spec

from simbev_ros.foundation.errors import InputError
from simbev_ros.scene.weather_course import WeatherCourse


def test_parameters_change_linearly_from_their_tick_on_and_stay() -> None:
    spec = made_up_spec([], ticks=100)
    course = WeatherCourse(spec)
    drawn = course.at(0)
    assert course.is_constant
    course.change({"precipitation": drawn.precipitation + 40.0}, tick=10, ticks=20)
    assert not course.is_constant
    assert course.at(9) == drawn == spec.weather_at(9)
    assert course.at(10).precipitation == pytest.approx(drawn.precipitation + 2.0)
    assert course.at(29) == course.at(99) == drawn.model_copy(update={"precipitation": drawn.precipitation + 40.0})
    course.change({"sun_altitude_deg": -20.0}, tick=20, ticks=1)
    assert course.at(19).sun_altitude_deg == drawn.sun_altitude_deg
    assert course.at(20).sun_altitude_deg == -20.0
    assert course.at(50).precipitation == pytest.approx(drawn.precipitation + 20.0), "a change ends at the next one"


def test_wrong_parameters_are_refused_and_change_nothing() -> None:
    course = WeatherCourse(made_up_spec([], ticks=3))
    for parameters, words in (({"rain": 3.0}, "rain: "), ({"precipitation": 300.0}, "precipitation: .*100")):
        with pytest.raises(InputError, match=f"^{words}"):
            course.change(parameters, tick=0, ticks=1)
    assert course.is_constant
