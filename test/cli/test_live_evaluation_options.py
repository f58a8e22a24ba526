"""The options by which run and replay evaluate a stack: what they say goes into the configuration, or is refused."""

from collections.abc import Callable
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from simbev_ros.cli.evaluate.live import print_live_tables, with_evaluation
from simbev_ros.config.agents import Agent
from simbev_ros.config.evaluation import Evaluation
from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError

pytestmark = pytest.mark.usefixtures("no_graph")

Refused = Callable[..., str]


def two_cars() -> Scenario:
    """The demo with a second agent, ``car``, and a drawn number of others."""
    demo = load_scenario("demo")
    rig = demo.rig.model_dump()
    agents = [Agent.model_validate({"name": "car", "rig": rig})]
    agents.append(Agent.model_validate({"name": "taxi", "rig": rig, "count": {"integer": [0, 2]}}))
    return demo.model_copy(update={"agents": tuple(agents)})


def test_without_options_nothing_changes() -> None:
    scenario = load_scenario("demo")
    assert with_evaluation(scenario, None, ()) is scenario
    assert scenario.evaluation is None


def test_options_fill_the_section_in(tmp_path: Path) -> None:
    section = Evaluation(participant="detector", boxes_topic="/boxes")
    scenario = load_scenario("demo").model_copy(update={"evaluation": section})
    changed = with_evaluation(scenario, tmp_path / "new/figures.json", ["detect --fast 'a b'"]).evaluation
    assert changed == Evaluation(
        participant="detector",
        boxes_topic="/boxes",
        stack=("detect", "--fast", "a b"),
        figures=str(tmp_path / "new/figures.json"),
    )


def test_the_reference_stack_has_its_own_name() -> None:
    scenario = load_scenario("demo").model_copy(update={"evaluation": Evaluation(participant="detector")})
    with pytest.raises(InputError, match=r"^--stack 'reference': participant: the stack reference is called "):
        with_evaluation(scenario, None, ["reference"])


@pytest.mark.parametrize(("stack", "words"), [("", "the command is empty"), ("say 'a", "No closing quotation")])
def test_no_command_is_refused(stack: str, words: str) -> None:
    with pytest.raises(InputError, match=f"^--stack .*: .*{words}"):
        with_evaluation(load_scenario("demo"), None, [stack])


@pytest.mark.parametrize(
    ("stack", "words"),
    [
        ("reference fast", "after reference may come nothing, not fast"),
        (
            "baseline-lidar a.onnx b.onnx",
            "after baseline-lidar may come one file of weights and --track, not a.onnx b.onnx",
        ),
        (
            "baseline-lidar --track --track",
            "after baseline-lidar may come one file of weights and --track, not --track --track",
        ),
        ("reference --track", "after reference may come nothing, not --track"),
    ],
)
def test_words_that_an_included_stack_does_not_take_are_refused(stack: str, words: str) -> None:
    with pytest.raises(InputError, match=f"^--stack '{stack}': stack: {words}$"):
        with_evaluation(load_scenario("demo"), None, [stack])


def test_missing_weights_are_refused_in_one_line_before_the_graph_starts(refused: Refused, tmp_path: Path) -> None:
    path = tmp_path / "mine.onnx"
    message = refused("run", "demo", "--stack", f"baseline-lidar {path}")
    assert message.startswith(f"error: {path}: there is no such file") and message.count("\n") == 1


def test_agents_have_stacks_and_figures_of_their_own(tmp_path: Path) -> None:
    changed = with_evaluation(two_cars(), tmp_path / "all.json", ["car=detect --fast", "reference"])
    assert changed.evaluation == Evaluation(stack=("reference",), figures=str(tmp_path / "all.json"))
    assert changed.agents[0].evaluation == Evaluation(
        boxes_topic="/car/prediction/boxes",
        grids_topic="/car/prediction/bev",
        stack=("detect", "--fast"),
        figures=str(tmp_path / "all_car.json"),
    )
    assert with_evaluation(two_cars(), None, ["ego=reference"]).evaluation == Evaluation(stack=("reference",))
    alone = with_evaluation(two_cars(), tmp_path / "folder", ["car=detect A=1"])
    assert (alone.evaluation, alone.agents[0].evaluation) == (
        None,
        Evaluation(
            boxes_topic="/car/prediction/boxes",
            grids_topic="/car/prediction/bev",
            stack=("detect", "A=1"),
            figures=str(tmp_path / "folder/car"),
        ),
    )
    assert (tmp_path / "folder/car").is_dir()


@pytest.mark.parametrize(
    ("stacks", "words"),
    [
        (["bus=detect"], "--stack 'bus=detect': every scene has these agents, but no 'bus': ego, car"),
        (["taxi=detect"], "--stack 'taxi=detect': every scene has these agents, but no 'taxi': ego, car"),
        (["car=a", "car=b"], "--stack 'car=b': car has a stack already; give each agent one"),
        (["a", "ego=b"], "--stack 'ego=b': ego has a stack already; give each agent one"),
        (["car=reference fast"], "--stack 'car=reference fast': stack: after reference may come nothing, not fast"),
    ],
)
def test_stacks_of_agents_that_cannot_have_them_are_refused(stacks: list[str], words: str) -> None:
    with pytest.raises(InputError, match=f"^{words}$"):
        with_evaluation(two_cars(), None, stacks)


def test_figures_must_have_a_place(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder.json").mkdir()
    for path, words in (("file/x.json", "file: cannot be written to: "), ("folder.json", "folder.json: is a folder; ")):
        with pytest.raises(InputError, match=f"{tmp_path}/{words}"):
            with_evaluation(load_scenario("demo"), tmp_path / path, ())


def test_the_command_line_hands_them_over(refused: Refused) -> None:
    assert refused("run", "demo", "--stack", "") == "error: --stack '': the command is empty\n"


def test_what_does_not_count_is_said() -> None:
    counts = {"evaluated": 3, "scenes": 1, "answered_boxes": 2, "answered_grids": 0, "missed": 1, "late": 4}
    frames = {**counts, "without_input": 5, "without_truth": 0, "malformed": 0}
    latency_ms = {"p50": 12.34, "p90": None, "p99": None}
    text = StringIO()
    print_live_tables({"frames": frames, "latency_ms": latency_ms}, Console(file=text, width=60))
    assert text.getvalue().splitlines()[-2:] == [
        "1 frames missed, 4 answers late, 0 unusable; latency: p50 12.3 ms",
        "5 frames do not count, as their input was left out or lost",
    ]
