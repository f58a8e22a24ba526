"""Messages of commands that play scenes and make datasets; and a file gets the finished bars, nothing else."""

import io
from pathlib import Path

import pytest
from made_up_scene import made_up_scene
from rich.console import Console

from simbev_ros.cli.console import make_console
from simbev_ros.cli.production_display import DatasetDisplay, SceneDisplay
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.scene.ending import DURATION, SceneEnd
from simbev_ros.scene.spec import SceneSpec


@pytest.fixture
def spec(tmp_path: Path) -> SceneSpec:
    return made_up_scene(tmp_path / "scene", ticks=4).spec


def console() -> Console:
    return make_console(file=io.StringIO(), width=100)


def written(console: Console) -> str:
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_a_scene_leaves_its_bar_and_why_it_ended_early(spec: SceneSpec) -> None:
    display = SceneDisplay(console())
    display.step_started("roads of Blocks")
    display.step_ended()
    display.map_noted("Blocks", "it has no [buildings]")
    display.leftover_removed(spec)
    display.graph_started(42, {})
    display.scene_started(spec)
    for tick in (None, 0, 3):
        display.scene_progressed(spec, tick)
    display.scene_ended(spec, SceneEnd(scene=spec.name, tick=3, reason="ego stood still"))
    lines = written(display.console).splitlines()
    assert lines[:3] == [
        "map Blocks: it has no [buildings]",
        f"{spec.name}: a run that was ended has left a part of it; it is made anew",
        "ROS_DOMAIN_ID=42",
    ]
    assert lines[3].startswith(f"{spec.name} ━") and "4/4 ticks" in lines[3]
    assert lines[-1] == f"{spec.name} ended early: ego stood still"


def test_a_scene_that_fails_leaves_no_message(spec: SceneSpec) -> None:
    display = SceneDisplay(console())
    display.scene_started(spec)
    display.scene_ended(spec, None)
    assert written(display.console).startswith(f"{spec.name}: loading ") and "ended" not in written(display.console)


def test_a_dataset_has_one_bar_over_its_scenes(spec: SceneSpec) -> None:
    display, entry = DatasetDisplay(console()), PlannedEntry(number=0, map="Blocks", split="train")
    display.dataset_started(2, 0)
    display.scene_started(spec)
    display.scene_progressed(spec, 1)
    display.scene_retried(spec, "world died")
    display.scene_progressed(spec, 3)
    display.scene_ended(spec, SceneEnd(scene=spec.name, tick=3, reason=DURATION))
    display.scene_made(entry, 1_500_000)
    display.scene_failed(entry, "world died again")
    display.dataset_ended()
    lines = written(display.console).splitlines()
    assert lines[0] == f"{spec.name}: world died; once more"
    assert lines[1].startswith(f"{spec.name} 4/4 ━") and "2.0/2 scenes" in lines[1] and "1.5 MB" in lines[1]


def test_without_scenes_there_is_no_bar() -> None:
    display = DatasetDisplay(console())
    display.dataset_started(0, 1_000)
    display.dataset_ended()
    assert written(display.console).strip() == ""
