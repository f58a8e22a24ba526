"""The stack that runs with a graph gets its topics and its weights, and what it lacks is refused before."""

import sys
from pathlib import Path

import pytest

from simbev_ros.baselines.modality import Modality
from simbev_ros.config.agents import Agent
from simbev_ros.config.evaluation import EvaluatedAgent, Evaluation
from simbev_ros.config.included_stacks import INCLUDED_STACKS
from simbev_ros.config.load import load_scenario
from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments
from simbev_ros.ros.graph.evaluated_stack import input_topic, require_stacks, stack_commands

FRONT = "/ego/cam_front_left/rgb/camera_info"
POINTS = "/ego/lidar/points"


def scenario_with_evaluation(section: dict[str, object], **parts: object) -> Scenario:
    return load_scenario("paper").model_copy(update={"evaluation": Evaluation.model_validate(section), **parts})


def with_second_agent(section: dict[str, object], name: str = "car", **first: object) -> Scenario:
    """The paper's configuration with a second agent, whose stack is evaluated; its rig is that of the first one."""
    paper = load_scenario("paper")
    agent = Agent.model_validate({"name": name, "rig": paper.rig.model_dump(), "evaluation": section})
    return paper.model_copy(update={"agents": (agent,), **first})


def command_of(scenario: Scenario, ros: RosArguments = PLAIN, *, live: bool = False) -> tuple[str, ...]:
    """Command of the only stack, the first agent's; empty: there is none."""
    commands = stack_commands(scenario, ros, live=live)
    assert commands.keys() <= {"stack"}
    return commands.get("stack", ())


def rig_with_rates(**rates_hz: float) -> Rig:
    """The paper's rig with rates for kinds of sensors."""
    rig = load_scenario("paper").rig
    sensors = tuple(each.model_copy(update={"rate_hz": rates_hz.get(each.type)}) for each in rig.sensors)
    return rig.model_copy(update={"sensors": sensors})


def rig_without(kind: str) -> Rig:
    rig = load_scenario("paper").rig
    return rig.model_copy(update={"sensors": tuple(each for each in rig.sensors if each.type != kind)})


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    """A file that could hold weights."""
    path = tmp_path / "my model.onnx"
    path.touch()
    return path


@pytest.mark.parametrize(
    ("kept", "section", "topic"),
    [
        (("camera", "gnss"), {}, "/ego/cam_front_left/rgb/camera_info"),
        (("gnss",), {}, "/ego/odom"),
        (("gnss",), {"answers_to": "/ego/gnss/fix"}, "/ego/gnss/fix"),
    ],
)
def test_a_stack_answers_to_the_configured_topic_or_else_the_first_sensor(
    kept: tuple[str, ...], section: dict[str, object], topic: str
) -> None:
    rig = load_scenario("paper").rig
    reduced = rig.model_copy(update={"sensors": tuple(each for each in rig.sensors if each.type in kept)})
    assert input_topic(EvaluatedAgent("", reduced, Evaluation.model_validate(section))) == topic


def test_the_reference_stack_gets_its_topics_relative_to_the_namespace_and_what_all_nodes_are_told() -> None:
    assert command_of(load_scenario("paper")) == command_of(scenario_with_evaluation({})) == ()
    assert command_of(scenario_with_evaluation({"stack": "run 'my stack'"})) == ("run", "my stack")
    command = command_of(scenario_with_evaluation({"stack": "reference", "grids_topic": "/grids"}))
    own = ("-p", "lidar_topic:=/ego/lidar/points", "--remap", "prediction/bev:=grids")
    assert command[1:] == ("-m", "simbev_ros.reference_stack", "--ros-args", *own)
    arguments = RosArguments("/sim1", ("-r", "/a:=/b"))
    command = command_of(scenario_with_evaluation({"stack": "reference", "grids_topic": "/grids"}), arguments)
    assert command[3:] == ("--ros-args", *own, "-r", "/a:=/b", "-r", "__ns:=/sim1")
    assert scenario_with_evaluation({"stack": "reference"}).participants == ("reference_stack",)


def test_the_reference_stack_knows_of_a_live_graph_whose_clouds_are_reliable() -> None:
    command = command_of(scenario_with_evaluation({"stack": "reference"}), live=True)
    assert command[3:] == ("--ros-args", "-p", "lidar_topic:=/ego/lidar/points", "-p", "live:=true")


def test_there_is_a_baseline_of_every_modality() -> None:
    found = [stack.modality for stack in INCLUDED_STACKS.values() if stack.modality is not None]
    assert sorted(found) == sorted(each.value for each in Modality)


@pytest.mark.parametrize("modality", Modality)
def test_a_baseline_gets_its_weights_and_a_lidar_if_it_sees_one(weights: Path, modality: Modality) -> None:
    scenario = scenario_with_evaluation({"stack": [f"baseline-{modality}", str(weights)]})
    lidar = ("-p", f"lidar_topic:={POINTS}") if modality.has_lidar else ()
    expected = (sys.executable, "-m", "simbev_ros.baselines.node", modality.value, str(weights), "--ros-args", *lidar)
    assert command_of(scenario) == expected
    assert scenario.participants == (f"baseline_{modality}",)


@pytest.mark.parametrize("words", [["--track"], ["WEIGHTS", "--track"], ["--track", "WEIGHTS"]])
def test_a_baseline_is_told_to_track(weights: Path, monkeypatch: pytest.MonkeyPatch, words: list[str]) -> None:
    monkeypatch.setattr("simbev_ros.baselines.model_file.weights_file", lambda _: weights)
    given = [str(weights) if word == "WEIGHTS" else word for word in words]
    command = command_of(scenario_with_evaluation({"stack": ["baseline-lidar", *given]}))
    assert command[3:6] == ("lidar", str(weights), "--track")


@pytest.mark.parametrize(
    ("name", "rates_hz", "topic"),
    [
        ("baseline-lidar", {"camera": 2}, POINTS),
        ("baseline-camera", {"camera": 10, "lidar": 5}, FRONT),
        ("baseline-fused", {}, FRONT),
        ("baseline-fused", {"camera": 2, "lidar": 4}, FRONT),
        ("baseline-fused", {"camera": 10, "lidar": 5}, POINTS),
        ("reference", {"camera": 2}, POINTS),
    ],
)
def test_an_included_stack_answers_to_the_slowest_sensor_that_it_sees(
    name: str, rates_hz: dict[str, float], topic: str
) -> None:
    assert input_topic(EvaluatedAgent("", rig_with_rates(**rates_hz), Evaluation(stack=(name,)))) == topic


def test_a_baseline_sees_the_lidar_that_it_answers_to(weights: Path) -> None:
    rig = load_scenario("paper").rig
    (lidar,) = (each for each in rig.sensors if each.type == "lidar")
    two = rig.model_copy(update={"sensors": (*rig.sensors, lidar.model_copy(update={"name": "roof"}))})
    for answers_to, seen in (("/ego/roof/points", "/ego/roof/points"), ("/ego/gnss/fix", POINTS)):
        section = {"stack": ["baseline-lidar", str(weights)], "answers_to": answers_to}
        assert f"lidar_topic:={seen}" in command_of(scenario_with_evaluation(section, rig=two))


def test_missing_weights_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "none.onnx"
    with pytest.raises(InputError, match=f"^{path}: there is no such file; baseline-lidar needs an ONNX file"):
        require_stacks(scenario_with_evaluation({"stack": ["baseline-lidar", str(path)]}))


def test_weights_that_the_package_lacks_are_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("simbev_ros.baselines.inference.WEIGHTS_FOLDER", tmp_path)
    with pytest.raises(InputError, match=r"comes without weights for the fused baseline .*; give a file of your own"):
        require_stacks(scenario_with_evaluation({"stack": "baseline-fused"}))


def test_without_onnx_runtime_the_message_says_how_to_install_it(
    monkeypatch: pytest.MonkeyPatch, weights: Path
) -> None:
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(InputError, match=r"^a baseline needs ONNX Runtime; install it: \S+ -m pip .*\[baselines\]'$"):
        require_stacks(scenario_with_evaluation({"stack": ["baseline-lidar", str(weights)]}))
    require_stacks(scenario_with_evaluation({"stack": "reference"}))


@pytest.mark.parametrize(
    ("stack", "kind", "lacking"),
    [
        ("reference", "lidar", "lidar with points"),
        ("baseline-fused", "lidar", "lidar with points"),
        ("baseline-camera", "camera", "camera with rgb images"),
    ],
)
def test_a_rig_without_what_the_stack_sees_is_refused(stack: str, kind: str, lacking: str) -> None:
    with pytest.raises(InputError, match=f"^evaluation.stack: {stack}: the rig of ego has no {lacking}$"):
        require_stacks(scenario_with_evaluation({"stack": stack}, rig=rig_without(kind)))


def test_stacks_of_several_agents_have_names_and_topics_of_their_own(weights: Path) -> None:
    first = Evaluation(stack=("reference",))
    scenario = with_second_agent({"stack": "reference"}, evaluation=first)
    assert scenario.participants == ("reference_stack", "car_reference_stack")
    commands = stack_commands(scenario)
    assert [*commands] == ["stack", "stack_car"]
    assert commands["stack"][3:] == ("--ros-args", "-p", "lidar_topic:=/ego/lidar/points")
    rules = (
        "__node:=car_reference_stack",
        "ego/odom:=car/odom",
        "prediction/boxes:=car/prediction/boxes",
        "prediction/boxes/markers:=car/prediction/boxes/markers",
        "prediction/bev:=car/prediction/bev",
    )
    remapping = tuple(word for rule in rules for word in ("--remap", rule))
    assert commands["stack_car"][3:] == ("--ros-args", "-p", "lidar_topic:=/car/lidar/points", *remapping)
    camera = with_second_agent({"stack": ["baseline-camera", str(weights)]})
    assert "agent:=car" in stack_commands(camera)["stack_car"]
    assert camera.participants == ("car_baseline_camera",)


def test_what_another_agents_stack_lacks_is_refused() -> None:
    scenario = with_second_agent({"stack": "reference"})
    blind = scenario.agents[0].model_copy(update={"rig": rig_without("lidar").model_copy(update={"agent": "car"})})
    with pytest.raises(InputError, match=r"^evaluation.stack: reference: the rig of car has no lidar with points$"):
        require_stacks(scenario.model_copy(update={"agents": (blind,)}))


def test_a_cooperative_stack_gets_the_clouds_and_the_answers_of_its_partners() -> None:
    scenario = with_second_agent({"stack": "reference"}, evaluation=Evaluation(stack=("cooperative",)))
    command = stack_commands(scenario)["stack"]
    assert command[1:3] == ("-m", "simbev_ros.reference_stack.cooperative")
    assert "partners:=[/car/lidar/points]" in command and "--remap" not in command
    reverse = with_second_agent({"stack": "cooperative"}, evaluation=Evaluation(participant="detector"))
    command = stack_commands(reverse)["stack_car"]
    assert {"partners:=[/ego/lidar/points]", "ego/prediction/boxes:=prediction/boxes"} <= set(command)
    assert reverse.participants == ("detector", "car_cooperative_stack")


def test_a_cooperative_stack_without_partners_is_refused() -> None:
    for first in (None, Evaluation(stack=("cooperative",))):
        with pytest.raises(InputError, match=r"cooperative: no other agent has a stack of its own that is evaluated$"):
            require_stacks(with_second_agent({"stack": "cooperative"}, evaluation=first))
    with pytest.raises(InputError, match=r"the stack of ego answers to /ego/gnss/fix; it must answer to points of a "):
        require_stacks(with_second_agent({"stack": "cooperative"}, evaluation=Evaluation(answers_to="/ego/gnss/fix")))
