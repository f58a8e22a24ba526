"""The shipped ``paper`` configuration contains every field; its values are the defaults but for later additions."""

from typing import Any

import pytest
import yaml
from pydantic import BaseModel

from simbev_ros.config.draw import Distribution
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.load import find_config, load_scenario
from simbev_ros.config.scenario import Scenario
from simbev_ros.config.traffic import Parked

SECTIONS = ("time", "ego", "weather", "lights", "traffic", "hazards", "annotation", "rendering", "recording")

LATER: dict[str, dict[str, Any]] = {
    "weather": {"season": "summer"},
    "traffic": {
        "distracted_probability": 0.0,
        "group_probability": 0.0,
        "parked": Parked(density=0),
        "resting_share": 0.0,
    },
    "hazards": {"count": 0},
}
"""What the paper's data did not have yet."""


@pytest.mark.parametrize("section", SECTIONS)
def test_every_section_equals_its_default(section: str) -> None:
    default = Scenario.model_fields[section].default
    changes = LATER.get(section, {})
    assert not changes.items() & default.model_dump().items()
    assert getattr(load_scenario("paper"), section) == default.model_copy(update=changes)


def test_rain_does_not_weaken_the_papers_lidar() -> None:
    (lidar,) = load_scenario("paper").rig.of_type(Lidar)
    assert not lidar.weather_effects


@pytest.mark.parametrize("section", SECTIONS)
def test_every_field_is_listed(section: str) -> None:
    data = yaml.safe_load(find_config("paper").read_text(encoding="utf-8"))
    assert_listed(Scenario.model_fields[section].default, data[section])


def assert_listed(model: BaseModel, data: dict[str, Any]) -> None:
    assert set(data) == set(type(model).model_fields)
    for name, value in model:
        if isinstance(value, BaseModel) and not isinstance(value, Distribution):
            assert_listed(value, data[name])
