"""The section ``evaluation`` of agents: each stack has topics, names and files of its own."""

from pathlib import Path

import pytest

from simbev_ros.config.load import load_scenario, parse_scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.production.dataset import without_stack

RIG = "rig: {sensors: [{type: lidar, name: top}]}"
EGO = f"scenes: [{{map: Blocks, train: 1}}]\n{RIG}\n"


def with_agent(text: str, first: str = "null") -> str:
    return f"{EGO}evaluation: {first}\nagents:\n  - {{name: car, {RIG}, {text}}}\n"


def test_the_topics_of_an_agents_answers_begin_with_its_name() -> None:
    scenario = parse_scenario(with_agent("evaluation: {stack: reference}", first="{stack: reference}"), "x")
    first, car = scenario.evaluated_agents
    assert (first.name, first.evaluation.boxes_topic, first.evaluation.grids_topic) == (
        "",
        "/prediction/boxes",
        "/prediction/bev",
    )
    assert (car.name, car.evaluation.boxes_topic, car.evaluation.grids_topic) == (
        "car",
        "/car/prediction/boxes",
        "/car/prediction/bev",
    )
    assert (first.label("evaluator"), car.label("evaluator")) == ("evaluator", "evaluator_car")
    assert scenario.participants == ("reference_stack", "car_reference_stack")
    own = parse_scenario(with_agent("evaluation: {boxes_topic: /boxes, participant: fusion}"), "x")
    assert own.evaluated_agents[0].evaluation.boxes_topic == "/boxes"
    assert own.evaluated_agents[0].evaluation.grids_topic == "/car/prediction/bev"
    assert own.participants == ("fusion",)


def test_a_dump_reads_back_as_itself() -> None:
    scenario = parse_scenario(with_agent("evaluation: {stack: reference, truth: joint}"), "x")
    assert parse_scenario(scenario.as_yaml(), "dump") == scenario


def test_the_first_entry_of_the_list_has_the_section_of_the_first_agent() -> None:
    listed = EGO.replace(RIG, f"agents: [{{name: ego, {RIG}, evaluation: {{participant: echo}}}}]")
    assert parse_scenario(listed, "x") == parse_scenario(f"{EGO}evaluation: {{participant: echo}}", "x")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            with_agent("count: 2, evaluation: {participant: echo}"),
            r"x.yaml:5: agents\[0\].evaluation: an agent with count has no stack, as not every scene has it$",
        ),
        (
            with_agent("evaluation: {boxes_topic: /prediction/boxes}", first="{participant: echo}"),
            r"x.yaml:5: agents\[0\].evaluation.boxes_topic: /prediction/boxes is in evaluation, too; each agent needs ",
        ),
        (
            with_agent("evaluation: {figures: a.json}", first="{figures: a.json}"),
            r"x.yaml:5: agents\[0\].evaluation.figures: a.json is in evaluation, too",
        ),
        (
            f"{EGO}evaluation: {{truth: joint}}",
            "x.yaml:3: evaluation.truth: a scene with one agent has no joint truth; it must be own$",
        ),
        (with_agent("evaluation: {truth: mine}"), r"x.yaml:5: agents\[0\].evaluation.truth: .*'own' or 'joint'"),
        (
            with_agent("evaluation: {stack: reference, participant: car}"),
            r"x.yaml:5: agents\[0\].evaluation: participant: the stack reference is called reference_stack",
        ),
    ],
)
def test_an_error_names_the_file_the_line_and_the_field(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        load_scenario(path)


def test_production_runs_no_stack() -> None:
    scenario = parse_scenario(with_agent("evaluation: {participant: a}", first="{participant: b}"), "x")
    plain = without_stack(scenario)
    assert plain.participants == plain.evaluated_agents == ()
    assert plain == parse_scenario(with_agent("evaluation: null"), "x")
