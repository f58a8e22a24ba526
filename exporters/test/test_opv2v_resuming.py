"""An interrupted OPV2V export resumes, folders of outdated scenes and agents go, and bad input is explained."""

import json
import shutil
from pathlib import Path
from typing import Any

import made_up_scene
import pytest
from made_up_scene import SENSORS, made_up_spec, record_made_up
from nuscenes_tables import digest
from several_agents import MAST_SENSORS, car, made_up_agents, roadside_unit, with_agents
from typer.testing import CliRunner

from simbev_exporters.opv2v import export as opv2v_export
from simbev_exporters.opv2v.export import Exported, export_opv2v
from simbev_exporters.opv2v.frames import FrameSettings, frame_files
from simbev_ros.cli.main import app
from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.parallel import Processes
from simbev_ros.foundation.errors import InputError, SimbevError
from simbev_ros.recording.layout import locate_mcap
from simbev_ros.schema.scene.agents import AgentView

SETTINGS = FrameSettings()
BAG = "set/scenes/train/Blocks-0002"


def export(folder: Path, out: Path, **changes: Any) -> Exported:
    settings = {**{name: getattr(SETTINGS, name) for name in SETTINGS.__slots__}, **changes}
    return export_opv2v(open_dataset(folder / "set", threads=1), out, FrameSettings(**settings))


def simbev(*words: object) -> str:
    """Run a command in this process; return its output."""
    return CliRunner().invoke(app, list(map(str, words)), catch_exceptions=False).output


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a dataset of two scenes, ``set``; the first one has the agents ego, car and rsu."""
    record_made_up(tmp_path / BAG, made_up_agents())
    record_made_up(tmp_path / "set/scenes/train/Blocks-0003", made_up_spec(MAST_SENSORS, number=3))
    return tmp_path


def agents_in(out: Path, split: str = "train") -> set[str]:
    """Folders of agents, as scene and agent."""
    return {f"{path.parent.name}/{path.name}" for path in out.glob(f"{split}/*/*") if path.is_dir()}


def test_a_damaged_record_is_one_line(folder: Path) -> None:
    export(folder, folder / "out")
    for record in (folder / "out/.parts").iterdir():
        record.write_bytes(record.read_bytes().replace(b'"frames": ', b'"frames": "" ,"other": '))
    with pytest.raises(InputError, match=rf"\A{folder}/out/\.parts: cannot be read: [^\n]*\Z"):
        export(folder, folder / "out")


ALL = {"Blocks-0002/1", "Blocks-0002/3", "Blocks-0002/-1", "Blocks-0003/1"}


def test_an_interrupted_export_resumes(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = 0

    def fails_late(*arguments: Any) -> dict[str, bytes]:
        nonlocal calls
        calls += 1
        if calls == 6:  # in the third agent
            raise KeyboardInterrupt
        return frame_files(*arguments)

    export(folder, folder / "whole")
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(opv2v_export, "frame_files", fails_late)
        export(folder, folder / "out")
    assert agents_in(folder / "out") == {"Blocks-0002/1", "Blocks-0002/3"}
    assert export(folder, folder / "out").made == 2
    assert digest(folder / "out") == digest(folder / "whole")
    assert export(folder, folder / "out").made == 0
    record = json.loads((folder / "out/.parts/Blocks-0002.3.json").read_text())
    assert record["frames"] == 2 and record["agent"] == "car"


def test_processes_write_the_same_files(folder: Path) -> None:
    export(folder, folder / "one")
    dataset, steps = open_dataset(folder / "set", threads=1), list[tuple[int, int]]()
    export_opv2v(dataset, folder / "two", SETTINGS, pool=Processes(2), report=lambda *each: steps.append(each))
    assert digest(folder / "one") == digest(folder / "two")
    assert steps[0] == (0, 8) and steps[-1] == (8, 8)


@pytest.mark.parametrize(
    "changes", [{"rate_hz": 20.0}, {"classes": ("car",)}, {"min_points": 40}, {"cameras": ("cam_back_left",)}]
)
def test_other_settings_replace_all_files(folder: Path, changes: dict[str, Any]) -> None:
    export(folder, folder / "out")
    assert export(folder, folder / "out", **changes).made == 2
    export(folder, folder / "fresh", **changes)
    assert digest(folder / "out") == digest(folder / "fresh") and agents_in(folder / "out") == ALL


def test_agents_that_a_scene_no_longer_has_are_removed(folder: Path) -> None:
    export(folder, folder / "out")
    shutil.rmtree(folder / BAG)
    record_made_up(folder / BAG, with_agents(made_up_spec(SENSORS, number=2), car("truck", 1)))
    assert export(folder, folder / "out").made == 1
    assert agents_in(folder / "out") == {"Blocks-0002/1", "Blocks-0002/2", "Blocks-0003/1"}


def test_a_scene_moves_with_its_split(folder: Path) -> None:
    export(folder, folder / "out")
    shutil.rmtree(folder / BAG)
    spec = made_up_agents().model_copy(update={"split": "val"})
    record_made_up(folder / "set/scenes/val/Blocks-0002", spec)
    assert export(folder, folder / "out").made == 1
    assert agents_in(folder / "out") == {"Blocks-0003/1"}
    assert agents_in(folder / "out", "validate") == ALL - {"Blocks-0003/1"}
    assert not (folder / "out/train/Blocks-0002").exists()


def test_a_scene_that_is_damaged_is_named_and_has_no_folder(folder: Path) -> None:
    export(folder, folder / "out")
    file = locate_mcap(folder / BAG)
    data = bytearray(file.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 100] = bytes(100)
    file.write_bytes(data)
    done = export(folder, folder / "out")
    assert done.scenes == 1 and list(done.failures) == ["Blocks-0002"]
    assert agents_in(folder / "out") == {"Blocks-0003/1"} and not (folder / "out/train/Blocks-0002").exists()
    with pytest.raises(SimbevError, match="1 of 2 scenes could not be exported"):
        simbev("export", "opv2v", folder / "set", "--out", folder / "out")


def test_agents_without_a_lidar_are_left_out(tmp_path: Path) -> None:
    cameras = [each for each in MAST_SENSORS if each["type"] == "camera"]
    spec = with_agents(made_up_spec(SENSORS, number=2), roadside_unit("mast", cameras), roadside_unit("rsu"))
    record_made_up(tmp_path / BAG, spec)
    done = export(tmp_path, tmp_path / "out")
    assert done.without_lidar == {"mast": 1} and not done.many_stations
    assert agents_in(tmp_path / "out") == {"Blocks-0002/1", "Blocks-0002/-2"}, "it is the second station"
    record_made_up(tmp_path / "set/scenes/train/Blocks-0003", made_up_spec(cameras, number=3))
    assert "no agent has the cloud of a lidar" in export(tmp_path, tmp_path / "out").failures["Blocks-0003"]


@pytest.mark.parametrize(("ticks", "frames"), [((0, 3, 4), 4), ((1, 3, 5), None)])
def test_a_scene_has_the_frames_that_all_agents_have(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ticks: tuple[int, ...], frames: int | None
) -> None:
    """The roadside unit has clouds at some ticks alone."""
    values = made_up_scene._values

    def without_clouds(rng: Any, view: AgentView, tick: int) -> dict[str, Any]:
        found = values(rng, view, tick)
        if view.station is not None and tick not in ticks:
            del found["lidar/points"]
        return found

    monkeypatch.setattr(made_up_scene, "_values", without_clouds)
    record_made_up(tmp_path / BAG, with_agents(made_up_spec(SENSORS, number=2, ticks=6), roadside_unit()))
    done = export(tmp_path, tmp_path / "out")
    if frames is None:
        assert "at no frame of 10 per second have all agents a cloud" in done.failures["Blocks-0002"]
    else:
        assert done.frames == frames and not done.failures


def test_a_rate_must_divide_that_of_the_frames(folder: Path) -> None:
    with pytest.raises(InputError, match=r"^rate_hz: 3 does not divide the 20 frames/s of .*Blocks-0002$"):
        export(folder, folder / "out", rate_hz=3.0)
    assert not (folder / "out").exists()


def test_bad_input_is_explained(folder: Path) -> None:
    (folder / "real/validate").mkdir(parents=True)
    with pytest.raises(InputError, match="simbev has not written"):
        export(folder, folder / "real")
    with pytest.raises(
        InputError, match="cameras: no agent has images of cam_top, but of cam, cam_back_left, cam_front"
    ):
        export(folder, folder / "out", cameras=("cam", "cam_top"))
    (folder / "empty/set/scenes").mkdir(parents=True)
    with pytest.raises(InputError, match="no finished scene to export"):
        export(folder / "empty", folder / "out")
    words = ("export", "opv2v", folder / "set", "--out", folder / "out")
    for more, message in (
        (("--classes", "car,ship"), "classes: there is no 'ship'; allowed: car, truck"),
        (("--classes", "car,car"), "classes: 'car,car' must be different words"),
        (("--cameras", "a,b,c,d,e"), "cameras: 'a,b,c,d,e' are 5; the layout has 4"),
    ):
        with pytest.raises(InputError, match=message):
            simbev(*words, *more)
    assert not (folder / "out").exists()


def test_the_command_reports_what_it_made(folder: Path) -> None:
    spec = with_agents(made_up_spec(SENSORS, number=4), roadside_unit("rsu"), roadside_unit("second"))
    record_made_up(folder / "set/scenes/train/Blocks-0004", spec)
    words = ("export", "opv2v", folder / "set", "--out", folder / "out", "--workers", 1)
    first, second = simbev(*words), simbev(*words, "--cameras", "cam_front,cam")
    assert f"14 frames of 7 agents in 3 scenes in {folder / 'out'}" in first
    assert "cameras of ego, car: 0 cam_front, 2 cam_back_left\ncameras of rsu, second: 0 cam\n" in first
    assert "1 scene with more than one roadside unit, of which OpenCOOD takes one for the ego: Blocks-0004" in first
    assert "cameras of ego, car: 0 cam_front; left out: cam_back_left\ncameras of rsu, second: 1 cam\n" in second
    assert "3 scenes were there already" in simbev(*words, "--cameras", "cam_front,cam")
