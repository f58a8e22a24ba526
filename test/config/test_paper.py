"""The shipped ``paper`` configuration contains every field, and its values equal the defaults."""

from typing import Any

import pytest
import yaml
from pydantic import BaseModel

from simbev_ros.config.draw import Distribution
from simbev_ros.config.load import find_config, load_scenario
from simbev_ros.config.scenario import Scenario

SECTIONS = ("time", "ego", "weather", "lights", "traffic", "hazards", "annotation", "rendering", "recording")


@pytest.mark.parametrize("section", SECTIONS)
def test_every_section_equals_its_default(section: str) -> None:
    assert getattr(load_scenario("paper"), section) == Scenario.model_fields[section].default


@pytest.mark.parametrize("section", SECTIONS)
def test_every_field_is_listed(section: str) -> None:
    data = yaml.safe_load(find_config("paper").read_text(encoding="utf-8"))
    assert_listed(Scenario.model_fields[section].default, data[section])


def assert_listed(model: BaseModel, data: dict[str, Any]) -> None:
    assert set(data) == set(model.model_dump())
    for name, value in model:
        if isinstance(value, BaseModel) and not isinstance(value, Distribution):
            assert_listed(value, data[name])
