"""Exports of labeled images resume and follow their dataset; settings choose their content; bad input is explained."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from made_up_scene import SENSORS, made_up_spec, record_made_up
from nuscenes_tables import digest
from several_agents import car, with_agents
from typer.testing import CliRunner

from simbev_exporters.coco.layout import Coco
from simbev_exporters.kitti.layout import Kitti
from simbev_exporters.labeled_images.export import Exported, export_images
from simbev_exporters.labeled_images.layout import Layout
from simbev_exporters.yolo.layout import Yolo
from simbev_ros.cli.main import app
from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.parallel import Processes
from simbev_ros.foundation.errors import InputError, SimbevError
from simbev_ros.foundation.types import Table
from simbev_ros.recording.layout import locate_mcap
from simbev_ros.schema.views import VIEW_DTYPE

SCENES = {2: "train", 3: "val", 4: "test"}
LAYOUTS = {layout.name: layout for layout in (Coco, Yolo, Kitti)}
CAMERAS = ("cam_front", "cam_back_left")
TICKS = 3
"""One frame at the default rate."""


def views(visible_px: int = 9) -> Table:
    """A hidden car; then a truck, a pedestrian and a barrier of which few, twice and thrice as many pixels are seen."""
    table = np.zeros(4, VIEW_DTYPE)
    table["id"], table["class"], table["alone_px"] = [2, 3, 7, 9], [0, 1, 5, 9], 40
    table["visible_px"] = [0, visible_px, 2 * visible_px, 3 * visible_px]
    for edge, low in (("left", 3), ("top", 4), ("right", 9), ("bottom", 8)):
        table[edge] = table[f"amodal_{edge}"] = low + 0.5
    return table


def record(folder: Path, number: int, split: str) -> None:
    spec = made_up_spec(SENSORS, number=number, split=split, ticks=TICKS)
    tables = {f"/ego/{name}/boxes": views() for name in CAMERAS}
    record_made_up(folder / f"set/scenes/{split}/Blocks-{number:04d}", spec, tables=tables)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a dataset, ``set``, of a scene in each split."""
    folder = tmp_path_factory.mktemp("made")
    for number, split in SCENES.items():
        record(folder, number, split)
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    """A folder with a copy of the dataset."""
    shutil.copytree(made / "set", tmp_path / "set")
    return tmp_path


def export(folder: Path, out: Path, layout: Layout, **options: Any) -> Exported:
    return export_images(open_dataset(folder / "set", threads=1), out, layout, **options)


def simbev(*words: object) -> str:
    """Run a command in this process; return its output."""
    return CliRunner().invoke(app, list(map(str, words)), catch_exceptions=False).output


@pytest.mark.parametrize("kind", [Coco, Yolo, Kitti])
def test_an_interrupted_export_resumes(folder: Path, monkeypatch: pytest.MonkeyPatch, kind: type[Layout]) -> None:
    layout, calls, sample = kind(), 0, kind.sample
    images = 3 if kind is Kitti else 6

    def fails_late(*arguments: Any) -> Any:
        nonlocal calls
        calls += 1
        if calls == images * 2 // 3:  # in the second scene
            raise KeyboardInterrupt
        return sample(*arguments)

    done, steps = export(folder, folder / "whole", layout), list[tuple[int, int]]()
    assert done.images == dict.fromkeys(SCENES.values(), images // 3)
    assert (done.scenes, done.made, done.objects) == (3, 3, 2 * images)
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(kind, "sample", fails_late)
        export(folder, folder / "out", layout)
    again = export(folder, folder / "out", layout, pool=Processes(2), report=lambda *each: steps.append(each))
    assert again.made == 2 and steps[0] == (0, images * 2 // 3) and steps[-1] == (images * 2 // 3,) * 2
    assert digest(folder / "out") == digest(folder / "whole")
    assert export(folder, folder / "out", layout).made == 0


@pytest.mark.parametrize("kind", [Coco, Yolo, Kitti])
def test_an_export_follows_its_dataset(folder: Path, kind: type[Layout]) -> None:
    """A scene moves to another split, one vanishes, one is new, and another layout is in the same folder."""
    other = next(each for each in LAYOUTS.values() if each is not kind)()
    export(folder, folder / "out", kind())
    for number in (2, 3):
        shutil.rmtree(folder / f"set/scenes/{SCENES[number]}/Blocks-{number:04d}")
    record(folder, 2, "test")
    record(folder, 5, "train")
    for out in ("out", "fresh"):
        export(folder, folder / out, other)
        assert export(folder, folder / out, kind()).made == (2 if out == "out" else 3)
    assert digest(folder / "out") == digest(folder / "fresh")


@pytest.mark.parametrize("changes", [{"rate_hz": 20.0}, {"classes": ("pedestrian", "car")}, {"min_pixels": 10}])
@pytest.mark.parametrize("kind", [Coco, Yolo, Kitti])
def test_other_settings_replace_all_files(folder: Path, kind: type[Layout], changes: dict[str, Any]) -> None:
    export(folder, folder / "out", kind())
    assert export(folder, folder / "out", kind(**changes)).made == 3
    export(folder, folder / "fresh", kind(**changes))
    assert digest(folder / "out") == digest(folder / "fresh")


@pytest.mark.parametrize("item", ["images", "objects", "facts"])
@pytest.mark.parametrize("kind", [Coco, Kitti])
def test_a_damaged_record_is_one_line(folder: Path, kind: type[Layout], item: str) -> None:
    export(folder, folder / "out", kind())
    for record in (folder / "out/.parts").iterdir():
        record.write_bytes(record.read_bytes().replace(f'"{item}": '.encode(), b'"other": '))
    with pytest.raises(InputError, match=rf"\A{folder}/out/\.parts: cannot be read: [^\n]*\Z"):
        export(folder, folder / "out", kind())


def test_a_scene_that_is_damaged_is_named_and_has_no_files(folder: Path) -> None:
    export(folder, folder / "out", Yolo())
    file = locate_mcap(folder / "set/scenes/val/Blocks-0003")
    data = bytearray(file.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 100] = bytes(100)
    file.write_bytes(data)
    done = export(folder, folder / "out", Yolo())
    assert done.scenes == 2 and list(done.failures) == ["Blocks-0003"]
    assert not list((folder / "out").glob("*/val/*"))
    assert "val" not in yaml.safe_load((folder / "out/data.yaml").read_text())
    with pytest.raises(SimbevError, match="1 of 3 scenes could not be exported"):
        simbev("export", "yolo", folder / "set", "--out", folder / "out")


def test_options_choose_classes_objects_and_cameras(folder: Path) -> None:
    out = folder / "out"
    words = ("export", "yolo", folder / "set", "--out", out, "--workers", 1)
    assert f"6 images with 12 objects of 3 scenes in {out}\ntrain: 2, val: 2, test: 2\n" in simbev(*words)
    assert "6 images with 18 objects" in simbev(*words, "--all")
    names = yaml.safe_load((out / "data.yaml").read_text())["names"]
    assert names[9] == "barrier" and len(names) == 10
    assert "3 images with 3 objects" in simbev(*words, "--cameras", "cam_front", "--pixels", 10)
    chosen = simbev(*words, "--all", "--classes", "pedestrian,car")
    assert "6 images with 6 objects" in chosen
    assert yaml.safe_load((out / "data.yaml").read_text())["names"] == {0: "pedestrian", 1: "car"}
    label = next((out / "labels/train").iterdir()).read_text()
    assert label == "0 0.218750 0.291667 0.187500 0.166667\n", "columns 4 to 9 of 32, rows 5 to 8 of 24"
    assert "3 scenes were there already" in simbev(*words, "--classes", "pedestrian,car")
    assert "with 0 objects of 3 scenes" in simbev(*words, "--classes", "motorcycle")
    simbev("export", "coco", folder / "set", "--out", out, "--all", "--workers", 1)
    content = json.loads((out / "annotations/instances_val.json").read_text())
    assert [each["name"] for each in content["categories"]] == list(names.values())


@pytest.mark.parametrize("kind", [Coco, Yolo, Kitti])
def test_images_without_objects_are_written(folder: Path, kind: type[Layout]) -> None:
    for each in ("motorcycle", "traffic_light"):
        done = export(folder, folder / "out", kind(classes=(each,)))
        assert done.objects == 0 and done.images["train"] > 0
    assert not any(path.stat().st_size for path in (folder / "out").glob("label*/*/*.txt"))


def test_kitti_has_one_camera_and_sets_of_all_splits(folder: Path) -> None:
    words = ("export", "kitti", folder / "set", "--out", folder / "out", "--workers", 1)
    assert "left out, as KITTI's layout has one camera: cam_back_left" in simbev(*words)
    sets = {path.stem: path.read_text().split() for path in (folder / "out/ImageSets").iterdir()}
    train, val, test = (["020000"], ["030000"], ["040000"])
    assert sets == {"train": train, "val": val, "trainval": train + val, "test": test}
    assert {path.stem for path in (folder / "out/testing/label_2").iterdir()} == {*test}
    assert "left out" not in simbev(*words, "--camera", "cam_back_left")


def test_each_agent_has_a_folder(tmp_path: Path) -> None:
    spec = with_agents(made_up_spec(SENSORS, number=2, ticks=1), car("car", 2))
    tables = {f"/{agent}/cam_front/boxes": views() for agent in ("ego", "car")}
    record_made_up(tmp_path / "set/scenes/train/Blocks-0002", spec, tables=tables)
    out = simbev("export", "coco", tmp_path / "set", "--out", tmp_path / "out", "--agent", "all", "--workers", 1)
    assert out.count("1 image with 2 objects of 1 scene") == 2
    assert "left out, as no boxes were recorded in their images, or no instances: cam_back_left" in out
    images = [path.read_bytes() for path in (tmp_path / "out").glob("*/train/*.jpg")]
    assert len(images) == 2 and {path.name for path in (tmp_path / "out").iterdir()} == {"ego", "car"}


def test_what_a_layout_lacks_is_said(tmp_path: Path) -> None:
    spec = made_up_spec(SENSORS[:2], number=2, ticks=1)
    record_made_up(tmp_path / "set/scenes/train/Blocks-0002", spec)
    failures = {name: export(tmp_path, tmp_path / name, layout()).failures for name, layout in LAYOUTS.items()}
    assert "Blocks-0002: no frame of 2 per second has CAMERA/rgb, CAMERA/boxes" in failures["yolo"]["Blocks-0002"]
    assert "it has no cloud of a lidar" in failures["kitti"]["Blocks-0002"]


def test_bad_input_is_explained(folder: Path) -> None:
    (folder / "real/images").mkdir(parents=True)
    with pytest.raises(InputError, match="it holds images or labels that simbev has not written"):
        export(folder, folder / "real", Yolo())
    with pytest.raises(InputError, match="cameras: no scene has images of cam, but of cam_back_left, cam_front"):
        export(folder, folder / "out", Coco(cameras=("cam_front", "cam")))
    with pytest.raises(InputError, match="camera: no scene has images of top, but of cam_back_left, cam_front"):
        simbev("export", "kitti", folder / "set", "--out", folder / "out", "--camera", "top")
    with pytest.raises(InputError, match=r"^rate_hz: 3 does not divide the 20 frames/s of .*Blocks-0002$"):
        export(folder, folder / "out", Kitti(rate_hz=3.0))
    (folder / "empty/set/scenes").mkdir(parents=True)
    with pytest.raises(InputError, match="no finished scene to export"):
        export(folder / "empty", folder / "out", Coco())
    for name in LAYOUTS:
        words = ("export", name, folder / "set", "--out", folder / "out")
        with pytest.raises(InputError, match="classes: there is no 'ship'; allowed: car, truck"):
            simbev(*words, "--classes", "car,ship")
    shutil.copytree(folder / "set/scenes/val/Blocks-0003", folder / "set/scenes/train/Blocks-0003")
    with pytest.raises(InputError, match="Blocks-0003 and Blocks-0003 have the same number"):
        export(folder, folder / "out", Kitti())
    assert not (folder / "out").exists()
