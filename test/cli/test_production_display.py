"""Messages of commands that play scenes and make datasets; and a file gets the finished bars, nothing else."""

import io
from pathlib import Path

import pytest
from made_up_scene import made_up_scene
from rich.console import Console

from simbev_ros.cli.console import make_console
from simbev_ros.cli.production_display import DatasetDisplay, SceneDisplay
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.production.events import (
    DatasetEnded,
    DatasetStarted,
    GraphStarted,
    LeftoverRemoved,
    MapNoted,
    SceneEnded,
    SceneFailed,
    SceneMade,
    SceneProgressed,
    SceneRetried,
    SceneStarted,
    StepEnded,
    StepStarted,
    WorkerPrepares,
    WorkersChosen,
)
from simbev_ros.production.scene_cost import SceneCost
from simbev_ros.scene.ending import DURATION, SceneEnd
from simbev_ros.schema.scene.spec import SceneSpec


@pytest.fixture
def spec(tmp_path: Path) -> SceneSpec:
    return made_up_scene(tmp_path / "scene", ticks=4).spec


def console() -> Console:
    return make_console(file=io.StringIO(), width=100)


def written(console: Console) -> str:
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def bars(display: DatasetDisplay) -> list[str]:
    """Text of the bars that are shown."""
    tasks = display._bars.tasks
    return [f"{task.description} {task.fields['count'].removesuffix(' frames')}".strip() for task in tasks]


def test_workers_too_print_which_scene_is_recorded_again(spec: SceneSpec) -> None:
    display = DatasetDisplay(console())
    display.notify(LeftoverRemoved(spec.name))
    assert written(display.console).startswith(f"{spec.name}: an interrupted run left a part of it")


def test_a_scene_leaves_its_bar_and_why_it_ended_early(spec: SceneSpec) -> None:
    display = SceneDisplay(console())
    display.notify(StepStarted("roads of Blocks"))
    display.notify(StepEnded())
    display.notify(MapNoted("Blocks", "it has no [buildings]"))
    display.notify(LeftoverRemoved(spec.name))
    display.notify(GraphStarted(42, {}))
    display.notify(SceneStarted(spec))
    for tick in (None, 0, 3):
        display.notify(SceneProgressed(spec.name, tick))
    display.notify(SceneEnded(spec.name, SceneEnd(scene=spec.name, tick=3, reason="ego stood still")))
    lines = written(display.console).splitlines()
    assert lines[:3] == [
        "map Blocks: it has no [buildings]",
        f"{spec.name}: an interrupted run left a part of it; it is recorded again",
        "ROS_DOMAIN_ID=42",
    ]
    assert lines[3].startswith(f"{spec.name} ━") and "4/4 ticks" in lines[3]
    assert lines[-1] == f"{spec.name} ended early: ego stood still"


def test_a_scene_that_fails_leaves_no_message(spec: SceneSpec) -> None:
    display = SceneDisplay(console())
    display.notify(SceneStarted(spec))
    display.notify(SceneEnded(spec.name, None))
    assert written(display.console).startswith(f"{spec.name}: loading ") and "ended" not in written(display.console)


def test_of_a_dataset_the_bar_over_all_scenes_and_reasons_of_failures_stay(spec: SceneSpec) -> None:
    display, entry = DatasetDisplay(console()), PlannedEntry(number=0, map="Blocks", split="train")
    failing = entry.model_copy(update={"number": 1})
    display.notify(DatasetStarted(2, 0))
    display.notify(SceneStarted(spec))
    display.notify(SceneProgressed(spec.name, 1))
    display.notify(SceneEnded(spec.name, None))
    display.notify(SceneRetried(entry, "world died"))
    display.notify(SceneStarted(spec))
    display.notify(SceneProgressed(spec.name, 3))
    display.notify(SceneEnded(spec.name, SceneEnd(scene=spec.name, tick=3, reason=DURATION)))
    display.notify(SceneMade(entry, 1_500_000))
    display.notify(SceneFailed(failing, "world [died] again"))
    display.notify(DatasetEnded())
    lines = written(display.console).splitlines()
    assert lines[:2] == [f"{spec.name}: world died; once more", "Blocks-0001 failed: world [died] again"]
    assert lines[2].startswith("dataset ━") and "2.0/2 scenes, 1 failed" in lines[2] and "1.5 MB" in lines[2]
    assert len(lines) == 3, "the scenes' own bars are gone"


def test_each_scene_in_the_making_and_each_worker_that_prepares_has_a_bar(spec: SceneSpec) -> None:
    display = DatasetDisplay(make_console(file=io.StringIO(), width=100, force_terminal=True))
    other = spec.model_copy(update={"number": 1})
    display.notify(DatasetStarted(4, 0))
    display.notify(WorkerPrepares("worker-3", "roads of Blocks"))
    for scene, tick in ((spec, 0), (other, 2)):
        display.notify(SceneStarted(scene))
        display.notify(SceneProgressed(scene.name, tick))
    assert bars(display) == ["dataset 1.0/4 scenes", "worker-3: roads of Blocks", "Blocks-0000 1/4", "Blocks-0001 3/4"]
    display.notify(WorkerPrepares("worker-3", None))
    display.notify(SceneEnded(other.name, None))
    assert bars(display) == ["dataset 1.0/4 scenes", "Blocks-0000 1/4"]
    display.notify(DatasetEnded())


def test_the_number_of_workers_is_explained(spec: SceneSpec) -> None:
    display = DatasetDisplay(console())
    display.notify(WorkersChosen(3, SceneCost(wall_s=10.0, cpu_s=25.0, memory_mib=1024.0, frames=40)))
    assert written(display.console) == "3 workers: the first scene used 2.5 cores and 1.1 GB\n"


def test_without_scenes_there_is_no_bar() -> None:
    display = DatasetDisplay(console())
    display.notify(DatasetStarted(0, 1_000))
    display.notify(DatasetEnded())
    assert written(display.console).strip() == ""
