"""The section ``v2x``: who takes part, what is drawn for a scene, and errors with file and line."""

from pathlib import Path

import pytest
from made_up_scene import made_up_spec
from pydantic import ValidationError
from several_agents import car, with_agents

from simbev_ros.config.load import load_scenario, parse_scenario
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.scene.drawing.draw_v2x import draw_v2x
from simbev_ros.schema.scene.spec import SceneSpec

RIG = "rig: {sensors: [{type: imu, name: imu}]}"


def text_with(section: str, car: str = "", ego: str = "") -> str:
    """A configuration with ``ego`` in line 3, ``car`` in line 4, and the section from line 5 on."""
    return (
        "scenes: [{map: Blocks, train: 1}]\nagents:\n"
        f"  - {{name: ego, {RIG}{ego}}}\n  - {{name: car, {RIG}{car}}}\n{section}\n"
    )


def drawn(scenario: Scenario, seed: int = 1, names: tuple[str, ...] = ("ego", "car")) -> dict[str, object]:
    found = draw_v2x(scenario, seed, names)
    assert found is not None
    return found.model_dump(mode="json")


def test_without_the_section_nothing_is_exchanged() -> None:
    scenario = parse_scenario(text_with(""), "x")
    assert (scenario.v2x, scenario.v2x_agents, draw_v2x(scenario, 1, ["ego", "car"])) == (None, (), None)


def test_an_empty_section_means_the_defaults_and_a_dump_reads_back_as_itself() -> None:
    scenario = parse_scenario(text_with("v2x: {}"), "x")
    assert drawn(scenario) == {
        "rate_hz": 10.0,
        "latency_s": 0.1,
        "loss": 0.0,
        "min_points": 1,
        "min_visibility": 0.0,
        "pose_sigma_m": 0.0,
        "pose_yaw_sigma_deg": 0.0,
        "position_sigma_m": 0.0,
        "yaw_sigma_deg": 0.0,
        "range_m": 200.0,
        "agents": ["ego", "car"],
    }
    assert parse_scenario(scenario.as_yaml(), "dump") == scenario


def test_the_range_is_drawn_for_each_scene_and_the_latency_for_each_message() -> None:
    scenario = parse_scenario(
        text_with("v2x: {range_m: {uniform: [50, 90]}, latency_s: {choice: [0.1, 0.2]}, min_points: null}"), "x"
    )
    ranges = [drawn(scenario, seed)["range_m"] for seed in range(20)]
    assert len({*ranges}) == 20 and all(50 <= float(str(each)) <= 90 for each in ranges)
    assert ranges[3] == drawn(scenario, 3)["range_m"]
    spec = draw_v2x(scenario, 1, ["ego", "car"])
    assert spec is not None and scenario.v2x is not None
    assert (spec.latency_s, spec.min_points) == (scenario.v2x.latency_s, None)


def test_agents_may_take_no_part_and_two_are_needed_in_a_scene() -> None:
    text = text_with("v2x: {}", car=", count: {integer: [0, 3]}", ego=", v2x: false")
    scenario = parse_scenario(text, "x")
    assert scenario.v2x_agents == ("car_1", "car_2", "car_3")
    assert drawn(scenario, names=("ego", "car_1", "car_2"))["agents"] == ["car_1", "car_2"]
    assert draw_v2x(scenario, 1, ["ego", "car_1"]) is None
    assert parse_scenario(scenario.as_yaml(), "dump") == scenario


def test_a_specification_names_agents_that_the_scene_has() -> None:
    data = with_agents(made_up_spec([]), car("car", 1, [])).model_dump(mode="json")
    assert data["v2x"] is None
    spec = SceneSpec.model_validate(data | {"v2x": {"range_m": 10, "agents": ["ego", "car"]}})
    assert SceneSpec.model_validate_json(spec.model_dump_json()) == spec
    with pytest.raises(ValidationError, match=r"v2x.agents: there is no agent bus; the scene has ego, car"):
        SceneSpec.model_validate(data | {"v2x": {"range_m": 10, "agents": ["ego", "bus"]}})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            text_with("v2x: {rate_hz: 7}"),
            r"x.yaml:5: v2x.rate_hz: 7 does not divide the tick rate 20 Hz; allowed are 20",
        ),
        (text_with("v2x: {rate_hz: 0}"), r"x.yaml:5: v2x.rate_hz: .* greater than 0, not 0"),
        (text_with("v2x:\n  range_m: 0"), r"x.yaml:6: v2x.range_m: is 0, but 1 to 100000 is allowed"),
        (
            text_with("v2x:\n  loss: 0\n  range_m: {normal: [200, 50]}"),
            r"x.yaml:7: v2x.range_m: draws from -inf to inf, but 1 to 100000 is allowed; bound it with min and max",
        ),
        (text_with("v2x: {latency_s: -0.1}"), r"x.yaml:5: v2x.latency_s: is -0.1, but 0 to 10 is allowed"),
        (
            text_with("v2x: {latency_s: {uniform: [0, 20]}}"),
            r"x.yaml:5: v2x.latency_s: draws from 0 to 20, but 0 to 10",
        ),
        (text_with("v2x: {latency_s: soon}"), r"x.yaml:5: v2x.latency_s: .*valid number.*'soon'"),
        (text_with("v2x: {loss: 1.5}"), r"x.yaml:5: v2x.loss: .* less than or equal to 1, not 1.5"),
        (text_with("v2x: {min_points: 0}"), r"x.yaml:5: v2x.min_points: .* greater than or equal to 1, not 0"),
        (text_with("v2x: {min_visibility: 2}"), r"x.yaml:5: v2x.min_visibility: .* less than or equal to 1, not 2"),
        (text_with("v2x: {pose_sigma_m: -1}"), r"x.yaml:5: v2x.pose_sigma_m: .* greater than or equal to 0, not -1"),
        (text_with("v2x: {rang_m: 3}"), r"x.yaml:5: v2x.rang_m: unknown key; did you mean range_m\? allowed: rate_hz"),
        (text_with("v2x: 5"), r"x.yaml:5: v2x: .*V2x, not 5"),
        (
            text_with("v2x: {}", car=", v2x: false"),
            r"x.yaml:5: v2x: needs at least 2 agents that take part; found 1",
        ),
        (text_with("v2x: {}", car=", v2x: maybe"), r"x.yaml:4: agents\[1\].v2x: .*valid boolean.*'maybe'"),
        (text_with("v2x: {}", ego=", v2x: maybe"), r"x.yaml:3: agents\[0\].v2x: .*valid boolean.*'maybe'"),
        (
            f"scenes: [{{map: Blocks, train: 1}}]\n{RIG}\nv2x: {{}}",
            r"x.yaml:3: v2x: needs at least 2 agents that take part; found 1",
        ),
    ],
)
def test_an_error_names_the_file_the_line_and_the_field(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        load_scenario(path)
