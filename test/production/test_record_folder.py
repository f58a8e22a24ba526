"""After a killed run, scenes that come out the same are recorded again; about all others the user decides."""

import re
import shutil
from pathlib import Path

import pytest
from made_up_scene import made_up_scene
from scene_edits import with_ego

from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.lock import DatasetLock
from simbev_ros.foundation.errors import InputError
from simbev_ros.production.events import LeftoverRemoved, ProductionEvent
from simbev_ros.production.observer import ProductionObserver
from simbev_ros.production.record_folder import hold_record_folder
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.layout import scene_folder
from simbev_ros.schema.scene.spec import SceneSpec


@pytest.fixture
def scenario() -> Scenario:
    return load_scenario("demo")


@pytest.fixture
def spec(tmp_path: Path) -> SceneSpec:
    return made_up_scene(tmp_path / "elsewhere").spec


def killed(dataset: Path, scenario: Scenario, spec: SceneSpec) -> Path:
    """The remains of a recorder that was killed: a truncated file with the scene and the configuration."""
    writer = SceneBagWriter(scene_folder(dataset, spec.split, spec.name))
    writer.add_attachment("scene.json", "application/json", spec.model_dump_json().encode())
    writer.add_attachment("config.yaml", "application/yaml", scenario.as_yaml().encode())
    copy = shutil.copytree(writer.partial_path, dataset / "copy")
    writer.abandon()
    shutil.rmtree(writer.partial_path)
    return copy.rename(writer.partial_path)


class Removed(ProductionObserver):
    """Collects the names of scenes whose leftovers were removed."""

    def __init__(self) -> None:
        self.names: list[str] = []

    def notify(self, event: ProductionEvent) -> None:
        if isinstance(event, LeftoverRemoved):
            self.names.append(event.scene)


def hold(dataset: Path, scenario: Scenario, spec: SceneSpec, *, live: bool = False) -> list[str]:
    """Hold the folder for a scene; give the names of scenes whose leftovers were removed."""
    removed = Removed()
    with hold_record_folder(dataset, scenario, [spec], live=live, observer=removed):
        assert not list(dataset.glob("scenes/*/*.partial"))
        with pytest.raises(InputError, match="is writing into it"):
            DatasetLock(dataset)
    return removed.names


def test_a_part_of_the_same_scene_is_made_anew(tmp_path: Path, scenario: Scenario, spec: SceneSpec) -> None:
    killed(tmp_path / "set", scenario, spec)
    assert hold(tmp_path / "set", scenario, spec) == [spec.name]
    scene_folder(tmp_path / "set", spec.split, f"{spec.name}.partial").mkdir(parents=True)  # killed before its file
    assert hold(tmp_path / "set", scenario, spec) == [spec.name]
    assert hold(tmp_path / "set", scenario, spec) == []


def test_what_would_not_come_back_stays(tmp_path: Path, scenario: Scenario, spec: SceneSpec) -> None:
    partial = killed(tmp_path / "set", scenario, spec)
    before = {file.name: file.read_bytes() for file in partial.iterdir()}
    steered = with_ego(spec, driver="twist")
    others = [
        (scenario, spec.model_copy(update={"seed": spec.seed + 1}), False),
        (scenario.model_copy(update={"seed": scenario.seed + 1}), spec, False),
        (scenario, spec, True),
    ]
    for other_scenario, other_spec, live in others:
        with pytest.raises(InputError, match=re.escape(f"simbev repair {partial} saves what is in it")):
            hold(tmp_path / "set", other_scenario, other_spec, live=live)
    assert {file.name: file.read_bytes() for file in partial.iterdir()} == before
    shutil.rmtree(partial)
    killed(tmp_path / "set", scenario, steered)
    with pytest.raises(InputError, match="would not come back"):
        hold(tmp_path / "set", scenario, steered)


def test_while_another_process_records_nothing_is_touched(tmp_path: Path, scenario: Scenario, spec: SceneSpec) -> None:
    partial = killed(tmp_path / "set", scenario, spec)
    with DatasetLock(tmp_path / "set"), pytest.raises(InputError, match=r"process \d+ is writing into it"):
        hold(tmp_path / "set", scenario, spec)
    assert list(partial.iterdir())
