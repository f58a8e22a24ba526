"""``simbev scene``: what would be drawn, without simulating."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

CONFIG = """scenes: [{map: Blocks, train: 2}, {map: Blocks, test: 1}]
rig: {sensors: []}
time: {duration_s: {uniform: [2, 8]}}
weather: {wind_intensity: 30, final: {}}
traffic: {vehicles: 3, pedestrians: {integer: [100, 110]}}
"""


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "config.yaml"
    path.write_text(CONFIG)
    return path


def test_json_has_statistics_of_every_parameter_and_what_it_is_meant_to_be(
    simbev: Callable[..., Any], config: Path
) -> None:
    facts = json.loads(simbev("scene", config, "--count", 20, "--json").out)
    assert (facts["scenes"], facts["maps"]) == (20, {"Blocks": 20})
    parameters = facts["parameters"]
    assert {"weather.fog_falloff", "final_weather.cloudiness", "green_time_s", "vehicles.min_gap_m"} <= set(parameters)
    duration = parameters["duration_s"]
    assert (duration["meant"], duration["count"]) == ("uniform 2, 8", 20)
    assert 2 <= duration["min"] < duration["mean"] < duration["max"] <= 8
    assert sum(duration["histogram"]) == pytest.approx(1)
    assert parameters["weather.wind_intensity"]["meant"] == "fixed: 30"
    assert (parameters["weather.wind_intensity"]["mean"], parameters["weather.wind_intensity"]["sd"]) == (30, 0)
    assert parameters["final_weather.cloudiness"]["meant"] == "100·B(0.8, 1.0)"
    assert parameters["ego.reckless"]["meant"] == "yes with probability 0.01"
    assert parameters["vehicles.speed_factor"]["count"] == 60
    assert parameters["pedestrians"]["min"] >= 100
    assert parameters["hazards"]["meant"].startswith("each free position with hazards.probability")
    assert sum(facts["kinds"]["vehicles.blueprint"].values()) == 60


def test_without_a_count_the_scenes_of_the_configuration_are_drawn(simbev: Callable[..., Any], config: Path) -> None:
    text = simbev("scene", config).out
    assert "3 scenes: Blocks (3)" in text
    assert "\nweather\n  cloudiness " in text and "ego.blueprint" in text


def test_all_can_be_drawn_on_another_map(simbev: Callable[..., Any], config: Path) -> None:
    assert json.loads(simbev("scene", config, "--map", "Town02", "--json").out)["maps"] == {"Town02": 3}


def test_notes_are_counted_instead_of_repeated(simbev: Callable[..., Any], config: Path) -> None:
    config.write_text(CONFIG.replace("{integer: [100, 110]}", "9000, spawn_radius_m: 60"))
    error = simbev("scene", config).err
    assert error.count("room for") == 1
    assert "3 notes, the first: Blocks: room for" in error


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere.yaml"], "nowhere.yaml: no such file"),
        (["CONFIG", "--map", "Atlantis"], "no map is called 'Atlantis'"),
        (["CONFIG", "--count", "0"], "greater than or equal to 1"),
        (["CONFIG", "--count", "100001"], "less than or equal to 100000"),
    ],
)
def test_bad_input_ends_with_exit_code_2(
    refused: Callable[..., str], config: Path, arguments: list[str], message: str
) -> None:
    assert message in refused("scene", *(config if word == "CONFIG" else word for word in arguments))
