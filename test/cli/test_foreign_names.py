"""Names and links in a stranger's dataset never lead out of it: commands refuse them, and write nothing anywhere."""

import bz2
import json
from collections.abc import Callable
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from made_up_scene import SENSORS, made_up_scene, made_up_spec
from ros_messages import string

from simbev_ros.dataset.index import INDEX_FILE, update_index
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.layout import scenes_of
from simbev_ros.recording.qos import QosProfile

pytestmark = pytest.mark.usefixtures("no_graph")

Simbev = Callable[..., Any]
COMMANDS = (
    "info {bag}",
    "info {bag} --digest --report {out}/report.html",
    "export simbev {bag} --out {out}/simbev",
    "export nuscenes {bag} --out {out}/nuscenes",
    "replay {bag} demo --out {out}/replayed",
    "evaluate {own} {bag}",
)


@pytest.fixture
def out(tmp_path: Path) -> Path:
    (tmp_path / "home/out").mkdir(parents=True)
    return tmp_path / "home/out"


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """A dataset of one scene with an index, below the folder that names try to reach."""
    dataset = tmp_path / "home/set"
    made_up_scene(dataset / "scenes/train/Blocks-0000", ticks=1)
    assert update_index(dataset, scenes_of(dataset))[1] == {}
    return dataset


def listing(folder: Path, out: Path) -> dict[str, int]:
    """Sizes of everything below a folder except the output; links are not followed."""
    return {str(path): path.lstat().st_size for path in folder.rglob("*") if out not in path.parents}


def run_refused(simbev: Simbev, command: str, bag: Path, out: Path, own: Path, tmp_path: Path) -> str:
    """The one line with which a command refuses a bag or dataset; nothing was written but the output."""
    before = listing(tmp_path, out)
    answer = simbev(*command.format(bag=bag, out=out, own=own).split())
    assert answer.code == 2, answer
    assert "\n" not in answer.err.strip() and "bug" not in answer.err
    assert listing(tmp_path, out) == before
    return answer.err


def foreign_bag(path: Path, field: str, value: str) -> Path:
    """A bag whose scene.json has a value that no scene can have."""
    scene = json.loads(made_up_spec(SENSORS).model_dump_json())
    *parents, last = (int(key) if key.isdigit() else key for key in field.split("."))
    reduce(getitem, parents, scene)[last] = value
    with SceneBagWriter(path) as writer:
        writer.add_attachment("scene.json", "application/json", json.dumps(scene).encode())
        writer.add_attachment("map_source.bz2", "application/x-bzip2", bz2.compress(b""))
        writer.add_topic("/world/events", "std_msgs/msg/String", QosProfile())
        writer.write("/world/events", scene["number"], string("{}"))
        return writer.finish({"expected": '{"/world/events": 1}', "complete": "true"})


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A dataset of the user's, whose scene foreign predictions are compared with."""
    made_up_scene(tmp_path / "own/scenes/train/Blocks-0000", ticks=1)
    return tmp_path / "own"


@pytest.mark.parametrize("command", COMMANDS)
def test_no_command_follows_names_in_a_scene(
    simbev: Simbev, out: Path, own: Path, tmp_path: Path, command: str
) -> None:
    bag = foreign_bag(tmp_path / "home/bag", "split", "../../../escaped")
    message = run_refused(simbev, command, bag, out, own, tmp_path)
    assert "scene.json: split: " in message and "'../../../escaped'" in message


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("split", "[/nope]"),
        ("map.name", "/../../x"),
        ("map.name", "<script>"),
        ("map.path", "/etc/passwd"),
        ("map.path", "/tmp/..\0.osm"),
        ("agents.0.rig.agent", "../ego"),
    ],
)
def test_every_name_in_a_scene_is_checked(
    simbev: Simbev, out: Path, own: Path, tmp_path: Path, field: str, value: str
) -> None:
    bag = foreign_bag(tmp_path / "home/bag", field, value)
    message = run_refused(simbev, "info {bag}", bag, out, own, tmp_path)
    assert f"scene.json: {field}: " in message and repr(value) in message


def test_verify_reports_names_as_faults(simbev: Simbev, tmp_path: Path) -> None:
    answer = simbev("verify", foreign_bag(tmp_path / "bag", "split", "../escaped"), "--json")
    (fault,) = [each for each in json.loads(answer.out)["faults"] if each["place"] == "scene.json"]
    assert answer.code == 1 and fault["problem"].startswith("split: ") and "'../escaped'" in fault["problem"]


@pytest.mark.parametrize("command", ["info {bag} --report {out}/a.html", *COMMANDS[2:4], "evaluate {own} {bag}"])
@pytest.mark.parametrize(
    ("column", "value"),
    [("path", "scenes/train/../../../own/scenes/train/Blocks-0000"), ("name", "<script>"), ("split", "../../../x")],
)
def test_names_in_an_index_are_refused(
    simbev: Simbev, out: Path, own: Path, dataset: Path, tmp_path: Path, command: str, column: str, value: str
) -> None:
    change_index(dataset, column, value)
    message = run_refused(simbev, command, dataset, out, own, tmp_path)
    assert f"set/index.parquet: scene 0: {column}: " in message and value in message
    assert faults(simbev, dataset) == [f"index.parquet: {message.partition('index.parquet: ')[2].strip()}"]


def test_names_in_a_plan_are_refused(simbev: Simbev, out: Path, own: Path, dataset: Path, tmp_path: Path) -> None:
    plan = {"scenes": [{"number": 1, "map": "../../x", "split": "train"}]}
    (dataset / "plan.json").write_text(json.dumps(plan))
    message = run_refused(simbev, "generate demo --out {bag}", dataset, out, own, tmp_path)
    assert "set/plan.json: scenes.0.map: " in message and "'../../x'" in message
    assert faults(simbev, dataset) == [f"plan.json: {message.partition('plan.json: ')[2].strip()}"]


def test_files_that_a_description_names_elsewhere_are_not_read(simbev: Simbev, dataset: Path, tmp_path: Path) -> None:
    file = dataset / "scenes/train/Blocks-0000/metadata.yaml"
    description = yaml.safe_load(file.read_text())
    description["rosbag2_bagfile_information"]["relative_file_paths"] = ["../../../../secret.mcap"]
    file.write_text(yaml.safe_dump(description))
    (tmp_path / "home/secret.mcap").write_bytes(b"secret")
    assert "metadata.yaml: it differs from its copy in the file" in faults(simbev, dataset)
    assert simbev("info", dataset).code == 0


@pytest.mark.parametrize(
    ("entry", "commands"),
    [
        ("scenes", ("info {bag}", "generate demo --out {bag}", "replay {bag} demo --out {out}/replayed")),
        ("scenes/train", ("verify {bag}", "replay {bag} demo --merge rear")),
        ("scenes/train/Blocks-0000", ("evaluate {own} {bag}", "export simbev {bag} --out {out}/simbev")),
        ("scenes/train/Blocks-0000/Blocks-0000_0.mcap", ("info {bag}", "verify {bag}/scenes/train/Blocks-0000")),
        ("scenes/train/Blocks-0000/metadata.yaml", ("verify {bag}", "repair {bag}/scenes/train/Blocks-0000")),
        ("index.parquet", ("info {bag} --report {out}/a.html", "evaluate {own} {bag}")),
        ("plan.json", ("generate demo --out {bag}",)),
        ("logs/Blocks-0000.log", ("export simbev {bag} --out {out}/simbev",)),
    ],
)
def test_links_that_lead_out_of_a_dataset_are_refused(
    simbev: Simbev, out: Path, own: Path, dataset: Path, tmp_path: Path, entry: str, commands: tuple[str, ...]
) -> None:
    path, moved = dataset / entry, tmp_path / "moved"
    path.parent.mkdir(exist_ok=True)
    path.rename(moved) if path.exists() else moved.write_text("secret")
    path.symlink_to(moved)
    for command in commands:
        message = run_refused(simbev, command, dataset, out, own, tmp_path)
        assert f"{path}: leads out of " in message and f", to {moved}" in message


def test_a_dataset_may_be_a_link(simbev: Simbev, dataset: Path, tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(dataset)
    assert simbev("info", tmp_path / "link").code == 0
    assert simbev("info", tmp_path / "link/scenes/train/Blocks-0000").code == 0


def change_index(dataset: Path, column: str, value: str) -> None:
    table = pq.read_table(dataset / INDEX_FILE)
    index = table.column_names.index(column)
    pq.write_table(table.set_column(index, column, pa.array([value])), dataset / INDEX_FILE)


def faults(simbev: Simbev, dataset: Path) -> list[str]:
    """Places and problems that verify finds, besides those of the made-up bag."""
    answer = simbev("verify", dataset, "--json")
    assert answer.code == 1
    found = [f"{each['place']}: {each['problem']}" for each in json.loads(answer.out)["faults"]]
    return [fault for fault in found if "message counts are missing" not in fault]
