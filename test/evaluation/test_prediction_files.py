"""Files of predicted boxes, written by other libraries: their content, and every documented error."""

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from made_up_boxes import some_boxes
from peak_memory import at_most
from prediction_data import OTHER, SCENE, STAMPS_NS, some_columns

from simbev_ros.evaluation.metrics.boxes import Predictions
from simbev_ros.evaluation.predictions.dataset_predictions import PredictedScene, open_predictions, write_predictions
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.limits import MAX_UNPACKED_VARIABLE
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import AnyArray

Writer = Callable[[Path, dict[str, AnyArray]], Path]


def to_parquet(path: Path, columns: dict[str, AnyArray], **options: Any) -> Path:
    path = path.with_suffix(".parquet")
    pq.write_table(pa.table({name: pa.array(values) for name, values in columns.items()}), path, **options)
    return path


def to_npz(path: Path, columns: dict[str, AnyArray]) -> Path:
    path = path.with_suffix(".npz")
    np.savez(path, **columns)
    return path


def read(path: Path, scene: str = SCENE) -> PredictedScene:
    return open_predictions(path).for_dataset([SCENE, OTHER]).scene(scene, STAMPS_NS)


BOTH = pytest.mark.parametrize("write", [to_parquet, to_npz])


@BOTH
def test_columns_become_boxes_of_their_scene(tmp_path: Path, write: Writer) -> None:
    predicted = open_predictions(write(tmp_path / "all", some_columns()))
    assert set(predicted.scenes) == {SCENE, OTHER}
    scene = predicted.scene(SCENE, STAMPS_NS)
    found = scene.boxes()
    boxes = found.predictions.boxes
    assert [each.frame_id for each in found.references] == ["map"]
    np.testing.assert_array_equal(found.predictions.score, [0.5, 1.0])
    np.testing.assert_array_equal(boxes.frame, [0, 3])
    assert [BOX_CLASSES[label] for label in boxes.label] == ["car", "pedestrian"]
    np.testing.assert_array_equal(boxes.center_m, [[1, -1, 0.5], [3, 1, 0.5]])
    np.testing.assert_array_equal(boxes.size_m, [[4, 2, 1.5], [0.5, 0.5, 1.75]])
    np.testing.assert_array_equal(boxes.yaw_rad, [0.1, 0.3])
    np.testing.assert_array_equal(boxes.velocity_mps, [[1, 0.5, 0], [2, 0.25, 0]])
    assert scene.ticks_with_boxes == {0, 3} and scene.grid(0) is None
    bus = pickle.loads(pickle.dumps(predicted)).scene(OTHER, STAMPS_NS).boxes().predictions.boxes
    assert np.isnan(bus.velocity_mps).all() and bus.frame == [2]


@BOTH
def test_classes_may_be_numbers_or_numbers_as_text_and_columns_32_bit(tmp_path: Path, write: Writer) -> None:
    for number, classes in enumerate((np.array([0, 1, 5], np.uint8), np.array(["0", "bus", "5"]))):
        columns = some_columns(x=np.array([1, 2, 3], np.float32), y=np.array([1, 2, 3]), **{"class": classes})
        boxes = read(write(tmp_path / f"n{number}", columns)).boxes().predictions.boxes
        np.testing.assert_array_equal(boxes.label, [0, 5])
        np.testing.assert_array_equal(boxes.center_m[:, :2], [[1, 1], [3, 3]])


@BOTH
def test_stamps_can_replace_ticks(tmp_path: Path, write: Writer) -> None:
    stamps = some_columns(tick=None, stamp_ns=STAMPS_NS[[3, 0, 1]])
    np.testing.assert_array_equal(read(write(tmp_path / "a", stamps)).boxes().predictions.boxes.frame, [3, 1])
    both = write(tmp_path / "b", some_columns(tick=np.array([3, 0, 2]), stamp_ns=STAMPS_NS[[3, 0, 1]]))
    with pytest.raises(InputError, match=r"tick: row 2 is 2; it must be that of stamp_ns"):
        read(both).boxes()


def test_the_frame_of_reference_is_in_the_metadata(tmp_path: Path) -> None:
    path = to_npz(tmp_path / "n", some_columns(frame_id=np.array("ego/lidar")))
    assert read(path).boxes().references[0].frame_id == "ego/lidar"
    table = pa.table(some_columns()).replace_schema_metadata({"frame_id": "ego/radar"})
    pq.write_table(table, tmp_path / "p.parquet")
    assert read(tmp_path / "p.parquet").boxes().references == (("ego/radar", str(tmp_path / "p.parquet")),)


@BOTH
def test_an_empty_class_answers_without_a_box(tmp_path: Path, write: Writer) -> None:
    columns = some_columns(
        score=np.array([0.5, 0.2, np.nan]), x=np.full(3, 1.0), **{"class": np.array(["car", "bus", ""])}
    )
    scene = read(write(tmp_path / "a", columns))
    assert len(scene.boxes()) == 1 and scene.ticks_with_boxes == {0, 3}
    columns["score"][2] = 0.5
    with pytest.raises(InputError, match=r"score: row 2 is 0.5; it must be empty, like the class"):
        read(write(tmp_path / "b", columns)).boxes()


def test_parquet_nulls_mean_unknown_velocity_or_no_box(tmp_path: Path) -> None:
    columns = {name: values.tolist() for name, values in some_columns().items()}
    columns |= {"vx": [None, 1.0, 2.0], "vz": [1.0, None, None], "class": [0, 1, None], "score": [0.5, 0.5, None]}
    pq.write_table(pa.table(columns), tmp_path / "a.parquet")
    scene = read(tmp_path / "a.parquet")
    assert np.isnan(scene.boxes().predictions.boxes.velocity_mps).all() and scene.ticks_with_boxes == {0, 3}
    other = read(tmp_path / "a.parquet", OTHER).boxes().predictions.boxes
    assert np.isnan(other.velocity_mps).all()  # its vy is NaN


def test_columns_of_nulls_alone_have_no_type_and_mean_unknown(tmp_path: Path) -> None:
    columns = some_columns()
    nothing = pa.nulls(len(columns["class"]))
    unknown = read(to_parquet(tmp_path / "unknown", {**columns, **dict.fromkeys(("vx", "vy", "vz"), nothing)}))
    assert np.isnan(unknown.boxes().predictions.boxes.velocity_mps).all()
    assert len(unknown.boxes().predictions.score) == 2
    empty = read(to_parquet(tmp_path / "empty", {**columns, "class": nothing, "score": nothing}))
    assert len(empty.boxes().predictions.score) == 0 and empty.ticks_with_boxes == {0, 3}
    for name, what in (("tick", "a number"), ("x", "finite"), ("scene", "the name of a scene")):
        with pytest.raises(InputError, match=rf"{name}: .*{what}"):
            read(to_parquet(tmp_path / name, {**columns, name: nothing})).boxes()


@pytest.mark.parametrize("row_group_size", [1, 7, 64, 1000])
def test_rows_in_any_order_and_grouping_are_found(tmp_path: Path, row_group_size: int) -> None:
    rng = np.random.default_rng(3)
    scene = rng.choice([SCENE, OTHER, "Town01-0002"], 300)
    columns = {name: np.resize(values, 300) for name, values in some_columns().items()}
    columns |= {"scene": scene, "x": np.arange(300.0), "class": np.full(300, "car")}
    path = to_parquet(tmp_path / "a", columns, row_group_size=row_group_size)
    predicted = open_predictions(path)
    for name in (OTHER, SCENE, "Town01-0002", OTHER):
        boxes = predicted.scene(name, STAMPS_NS).boxes().predictions.boxes
        np.testing.assert_array_equal(boxes.center_m[:, 0], np.flatnonzero(scene == name))
    assert len(predicted.scene("Town01-0009", STAMPS_NS).boxes()) == 0
    columns["x"][np.flatnonzero(scene == OTHER)[40]] = np.inf
    row = np.flatnonzero(scene == OTHER)[40]
    path = to_parquet(tmp_path / "b", columns, row_group_size=row_group_size)
    with pytest.raises(InputError, match=rf"b.parquet: x: row {row} is inf; it must be a finite number"):
        open_predictions(path).scene(OTHER, STAMPS_NS).boxes()


@BOTH
def test_without_a_scene_column_the_stem_or_the_only_scene_is_used(tmp_path: Path, write: Writer) -> None:
    named = open_predictions(write(tmp_path / SCENE, some_columns(scene=None)))
    assert named.scenes == (SCENE,) and named.for_dataset([SCENE, OTHER]).scenes == (SCENE,)
    nameless = open_predictions(write(tmp_path / "mine", some_columns(scene=None)))
    assert nameless.scenes == ("mine",)
    only = nameless.for_dataset([OTHER])
    assert only.scenes == (OTHER,) and len(only.scene(OTHER, STAMPS_NS).boxes()) == 3
    with pytest.raises(InputError, match=r"mine.*: scene: there is no 'mine', taken from the file's name.*Blocks-0000"):
        nameless.for_dataset([SCENE, OTHER])


def test_files_in_a_folder_are_combined(tmp_path: Path) -> None:
    to_parquet(tmp_path / SCENE, some_columns(scene=None))
    to_npz(tmp_path / "more", some_columns(frame_id=np.array("ego/lidar")))
    found = read(tmp_path).boxes()
    assert len(found) == 5
    assert [found.references[index].frame_id for index in found.reference] == ["map"] * 3 + ["ego/lidar"] * 2


def test_written_predictions_are_read_back(tmp_path: Path) -> None:
    boxes = some_boxes(
        [[3, 2, 1], [0, 0, 0]], frame=[2, 0], velocity_mps=[[1, 2, 3], [np.nan] * 3], yaw_rad=[0.5, -1.5], label=[4, 9]
    )
    path = tmp_path / "out.parquet"
    write_predictions(path, [(SCENE, Predictions(boxes, np.array([0.25, 0.75])), [0, 1, 2])], "ego/base_link")
    scene = read(path)
    found, order = scene.boxes(), [1, 0]
    assert scene.ticks_with_boxes == {0, 1, 2} and found.references[0].frame_id == "ego/base_link"
    np.testing.assert_array_equal(found.predictions.score, [0.75, 0.25])
    for name in ("frame", "label", "center_m", "size_m", "yaw_rad", "velocity_mps", "attribute"):
        np.testing.assert_array_equal(getattr(found.predictions.boxes, name), getattr(boxes, name)[order])
    with pytest.raises(InputError, match="exists already"):
        write_predictions(path, [])


@BOTH
def test_ids_are_tracks(tmp_path: Path, write: Writer) -> None:
    found = read(write(tmp_path / "a", some_columns(id=np.array([7, 7, -3])))).boxes().predictions.boxes
    assert found.track.tolist() == [7, -1]
    assert read(write(tmp_path / "b", some_columns())).boxes().predictions.boxes.track.tolist() == [-1, -1]


@BOTH
def test_an_id_that_is_twice_in_a_frame_is_refused(tmp_path: Path, write: Writer) -> None:
    path = write(tmp_path / "a", some_columns(tick=np.array([3, 2, 3]), id=np.array([4, 4, 4])))
    with pytest.raises(InputError, match="id: row 2 is 4; it must be different in all boxes of a frame"):
        read(path).boxes()


def test_a_null_id_is_no_track(tmp_path: Path) -> None:
    ids = {"id": np.array([None, 1, 2**60 + 1], object)}
    assert read(to_parquet(tmp_path / "a", some_columns(**ids))).boxes().predictions.boxes.track.tolist() == [
        -1,
        2**60 + 1,
    ]


def test_written_tracks_are_read_back(tmp_path: Path) -> None:
    boxes = some_boxes([[3, 2, 1], [0, 0, 0], [9, 9, 9]], frame=[0, 0, 2])
    boxes.track[:] = [5, -1, 5]
    path = tmp_path / "out.parquet"
    write_predictions(path, [(SCENE, Predictions(boxes, np.ones(3)), [0, 1, 2])], tracks=True)
    assert read(path).boxes().predictions.boxes.track.tolist() == [5, -1, 5]


def test_a_file_without_rows_has_no_boxes(tmp_path: Path) -> None:
    write_predictions(tmp_path / "a.parquet", [])
    assert open_predictions(tmp_path / "a.parquet").scenes == ()
    assert len(read(tmp_path / "a.parquet").boxes()) == 0


VALUES = [
    ("class", np.array(["car", "bus", "tram"]), r"class: row 2 is 'tram'; it must be one of car, truck, .*, 0 to 9"),
    ("class", np.array([0, 1, 10]), r"class: row 2 is 10; it must be one of car"),
    ("class", np.array([0, 1, -2]), r"class: row 2 is -2; it must be one of car"),
    ("score", np.array([0.5, 0.5, np.nan]), r"score: row 2 is nan; it must be a finite number"),
    ("width", np.array([-2.0, 1.0, 1.0]), r"width: row 0 is -2.0; it must be at least 0"),
    ("z", np.array([np.inf, 1.0, 1.0]), r"z: row 0 is inf; it must be a finite number"),
    ("yaw", np.array([0.0, 1.0, np.nan]), r"yaw: row 2 is nan; it must be a finite number"),
    ("vx", np.array([np.inf, 1.0, 1.0]), r"vx: row 0 is inf; it must be a finite number, or NaN where"),
    ("tick", np.array([0, 0, 4]), r"tick: row 2 is 4; it must be 0 to 3, as Blocks-0000 has 4 frames"),
    ("tick", np.array([-1, 0, 3]), r"tick: row 0 is -1; it must be 0 to 3"),
    (
        "stamp_ns",
        np.array([*STAMPS_NS[:2], STAMPS_NS[2] + 9]),
        r"row 2 is 3600150000009; .* nearest is 3600150000000, that of tick 2",
    ),
    ("stamp_ns", np.array([7, 0, STAMPS_NS[0]]), r"stamp_ns: row 0 is 7; .* nearest is 3600050000000, that of tick 0"),
]


@BOTH
@pytest.mark.parametrize(("name", "values", "message"), VALUES)
def test_a_bad_value_is_named(tmp_path: Path, write: Writer, name: str, values: AnyArray, message: str) -> None:
    changes = {"tick": None, name: values} if name == "stamp_ns" else {name: values}
    path = write(tmp_path / "bad", some_columns(**changes))
    with pytest.raises(InputError, match=message) as caught:
        read(path).boxes()
    assert str(path) in str(caught.value)


OPENING = [
    ({"score": None}, r"score: there is no such column; it has class, height, length"),
    ({"yaw": None}, r"yaw: there is no such column"),
    ({"class": None}, r"class: there is no such column"),
    ({"tick": None}, r"tick: there is neither this column nor stamp_ns; it has class"),
    ({"tick": np.array([0.0, 2.0, 3.0])}, r"tick: is of the type (double|float64); it must be .*, integer"),
    ({"class": np.array([0.0, 2.0, 3.0])}, r"class: is of the type .*; it must be .*, integer or text"),
    ({"id": np.array([1.0, 2.0, 3.0])}, r"id: is of the type .*; it must be .*, integer"),
    ({"x": np.array(["1", "2", "3"])}, r"x: is of the type .*; it must be .*, float or integer"),
    ({"scene": np.array([1, 2, 3])}, r"scene: is of the type int64; it must be .*, text"),
]


@BOTH
@pytest.mark.parametrize(("changes", "message"), OPENING)
def test_a_bad_column_is_named_on_opening(tmp_path: Path, write: Writer, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=rf"bad\..*: {message}"):
        open_predictions(write(tmp_path / "bad", some_columns(**changes)))


@BOTH
def test_a_velocity_needs_both_horizontal_parts(tmp_path: Path, write: Writer) -> None:
    with pytest.raises(
        InputError, match=r"vy: this column is missing, although there is vx; a velocity needs vx and vy"
    ):
        read(write(tmp_path / "a", some_columns(vy=None))).boxes()


@BOTH
def test_an_unknown_scene_is_named(tmp_path: Path, write: Writer) -> None:
    predicted = open_predictions(write(tmp_path / "a", some_columns()))
    with pytest.raises(InputError, match=r"scene: there is no 'Blocks-0001'; the dataset has Blocks-0000"):
        predicted.for_dataset([SCENE])


def test_npz_columns_of_other_types_are_refused(tmp_path: Path) -> None:
    as_bytes = {"class": np.array([b"car", b"bus", b"pedestrian"]), "scene": np.array([SCENE, OTHER, SCENE], bytes)}
    scene = read(to_npz(tmp_path / "a", some_columns(frame_id=np.array(b"ego/lidar"), **as_bytes)))
    assert [BOX_CLASSES[label] for label in scene.boxes().predictions.boxes.label] == ["car", "pedestrian"]
    assert scene.boxes().references[0].frame_id == "ego/lidar"
    for name, values, message in (
        ("class", np.array(0), "class: is of the type int64; it must be one-dimensional, integer or text"),
        ("x", np.zeros((3, 1)), "x: is of the type float64; it must be one-dimensional"),
        ("x", np.zeros(2), "x: has 2 rows; class has 3"),
        ("class", np.array([b"car", b"bus", "piéton".encode("latin1")]), "class: is not UTF-8: "),
    ):
        with pytest.raises(InputError, match=rf"b\.npz: {message}"):
            open_predictions(to_npz(tmp_path / "b", some_columns(**{name: values})))


def test_a_missing_scene_or_tick_is_named(tmp_path: Path) -> None:
    columns = {name: values.tolist() for name, values in some_columns().items()}
    pq.write_table(pa.table({**columns, "scene": [SCENE, None, SCENE]}), tmp_path / "a.parquet")
    with pytest.raises(InputError, match=r"scene: row 1 is None; it must be the name of a scene"):
        open_predictions(tmp_path / "a.parquet")
    pq.write_table(pa.table({**columns, "tick": [0, 0, None]}), tmp_path / "b.parquet")
    with pytest.raises(InputError, match=r"tick: row 2 is None; it must be a number"):
        read(tmp_path / "b.parquet").boxes()


def test_duplicate_column_names_are_refused(tmp_path: Path) -> None:
    table = pa.table(some_columns())
    pq.write_table(table.append_column("x", table.column("y")), tmp_path / "a.parquet")
    with pytest.raises(InputError, match=r"x: there is more than one column of this name"):
        open_predictions(tmp_path / "a.parquet")


@BOTH
def test_a_damaged_file_raises_input_error(tmp_path: Path, write: Writer) -> None:
    path = write(tmp_path / "a", some_columns())
    whole = path.read_bytes()
    for size in (0, 10, len(whole) // 2, len(whole) - 3):
        path.write_bytes(whole[:size])
        with pytest.raises(InputError, match=r"cannot be read as (Parquet|NPZ)|there is no such column"):
            read(path).boxes()
    rng = np.random.default_rng(0)
    for _ in range(60):
        damaged = bytearray(whole)
        damaged[rng.integers(len(whole))] ^= 1 << rng.integers(8)
        path.write_bytes(damaged)
        try:
            open_predictions(path).scene(SCENE, STAMPS_NS).boxes()
        except InputError as error:
            assert str(path) in str(error)


def test_npz_of_objects_unequal_lengths_or_shapes_is_refused(tmp_path: Path) -> None:
    objects = np.array(["car", "bus", "car"], object)
    with pytest.raises(InputError, match=r"class: cannot be read as NPZ: it holds Python objects; texts must be"):
        open_predictions(to_npz(tmp_path / "a", some_columns(**{"class": objects})))
    with pytest.raises(InputError, match=r"x: has 2 rows; class has 3"):
        open_predictions(to_npz(tmp_path / "b", some_columns(x=np.zeros(2))))
    with pytest.raises(InputError, match=r"x: is of the type float64; it must be one-dimensional"):
        open_predictions(to_npz(tmp_path / "c", some_columns(x=np.zeros((3, 1)))))
    with pytest.raises(InputError, match=r"frame_id: has the shape \(2,\)"):
        open_predictions(to_npz(tmp_path / "d", some_columns(frame_id=np.array(["map", "map"]))))
    np.save(tmp_path / "e.npy", np.zeros(3))
    (tmp_path / "e.npy").rename(tmp_path / "e.npz")
    with pytest.raises(InputError, match=r"e.npz: cannot be read as NPZ: File is not a zip file"):
        open_predictions(tmp_path / "e.npz")


def test_a_path_without_predictions_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere: no such file or folder"):
        open_predictions(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"holds no predictions; allowed are \*.parquet, \*.npz, grids/ and bags"):
        open_predictions(tmp_path)


def test_an_npz_bomb_is_refused_before_it_is_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(MAX_UNPACKED_VARIABLE, "8")
    np.savez_compressed(tmp_path / "a.npz", **some_columns(score=np.zeros(4 << 20)))
    assert (tmp_path / "a.npz").stat().st_size < 1 << 17
    with (
        at_most(8),
        pytest.raises(InputError, match=r"a\.npz: .* NPZ: it unpacks to \d+ MiB; at most 8"),
    ):
        open_predictions(tmp_path / "a.npz")


@pytest.mark.parametrize("rows_per_group", [1 << 21, 1 << 16])
@pytest.mark.parametrize("named", [True, False])
def test_a_parquet_bomb_is_refused_before_it_is_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows_per_group: int, named: bool
) -> None:
    monkeypatch.setenv(MAX_UNPACKED_VARIABLE, "16")
    columns = {name: np.broadcast_to(values[:1], 1 << 20) for name, values in some_columns().items()}
    if not named:
        del columns["scene"]
    file = to_parquet(tmp_path / "a", columns, row_group_size=rows_per_group)
    assert file.stat().st_size < 1 << 18
    with (
        at_most(32),
        pytest.raises(InputError, match=r"a\.parquet: .* of 1,048,576 rows unpacks to .*; at most 16"),
    ):
        read(file).boxes()


def test_the_package_offers_what_writes_predictions() -> None:
    from simbev_ros import evaluation
    from simbev_ros.evaluation.predictions import prediction_writer

    assert evaluation.write_predictions is prediction_writer.write_predictions
    assert evaluation.write_grid is prediction_writer.write_grid
    assert {*evaluation.__all__} >= {"Predictions", "write_grid", "write_predictions"}
