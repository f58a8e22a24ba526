"""Bags of predictions written by rosbags: boxes of each type, scores, assignment to scenes, every documented error."""

import pickle
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from prediction_bags import TABLE_DTYPE, detections, header, image, make, markers, occupancy, table_message, write_bag
from prediction_data import OTHER, SCENE, STAMPS_NS
from prediction_scene import spec

from simbev_ros.evaluation.predictions.dataset_predictions import PredictedScene, open_predictions
from simbev_ros.foundation.errors import BagError, InputError
from simbev_ros.foundation.semantics import BEV_CLASSES

BOXES, GRIDS = "/prediction/boxes", "/prediction/bev"
ENTRY = ("bus", 0.5, (1, 2, 3), (8, 2.5, 3), (0, 0, 0, 1))
CELLS = np.random.default_rng(4).random((4, 3, len(BEV_CLASSES))).astype(np.float32)


def table(count: int, x: float) -> Any:
    rows = np.ones(count, TABLE_DTYPE)
    rows["x"] = x
    return rows


def tables(ticks: Sequence[int] = (0, 2, 3), stamps_ns: Any = STAMPS_NS) -> list[tuple[str, int, Any]]:
    """Messages with as many boxes as the number of the tick, logged a little later than stamped."""
    return [
        (BOXES, int(stamps_ns[tick]) + 7, table_message(table(tick, tick), int(stamps_ns[tick]), "ego/lidar"))
        for tick in ticks
    ]


def scene_message(number: int) -> tuple[str, int, Any]:
    drawn = spec(number)
    return "/world/scene", drawn.start_ns, make("std_msgs/String", data=drawn.model_dump_json())


def read(path: Path, scenes: Sequence[str] = (SCENE,)) -> PredictedScene:
    return open_predictions(path).for_dataset(scenes).scene(SCENE, STAMPS_NS)


def test_tables_answer_their_frames_even_without_boxes(tmp_path: Path) -> None:
    scene = read(write_bag(tmp_path / SCENE, tables()), (SCENE, OTHER))
    found = scene.boxes()
    assert scene.ticks_with_boxes == {0, 2, 3}
    np.testing.assert_array_equal(found.predictions.boxes.frame, [2, 2, 3, 3, 3])
    np.testing.assert_array_equal(found.predictions.boxes.center_m[:, 0], [2, 2, 3, 3, 3])
    assert {each.frame_id for each in found.references} == {"ego/lidar"}


def test_message_types_defined_only_in_the_file_are_read(tmp_path: Path) -> None:
    messages = [(BOXES, 1, detections([ENTRY], header(int(STAMPS_NS[1]), "ego/base_link")))]
    scene = read(write_bag(tmp_path / "bag", messages))
    found = scene.boxes()
    np.testing.assert_array_equal(found.predictions.boxes.center_m, [[1, 2, 3]])
    assert scene.ticks_with_boxes == {1} and found.references[0].frame_id == "ego/base_link"


def test_markers_are_read_and_empty_arrays_answer_nothing(tmp_path: Path) -> None:
    nothing = markers([], header(1))
    nothing.markers = []
    messages = [(BOXES, 1, markers([ENTRY], header(int(STAMPS_NS[3])))), (BOXES, 2, nothing)]
    scene = read(write_bag(tmp_path / "bag", messages))
    assert len(scene.boxes()) == 1 and scene.ticks_with_boxes == {3}


def test_score_images_on_chosen_topics_are_read(tmp_path: Path) -> None:
    messages = [("/stack/bev", 1, image(CELLS, int(STAMPS_NS[1]))), ("/stack/boxes", 1, tables([2])[0][2])]
    path = write_bag(tmp_path / "bag", messages)
    scene = open_predictions(path, "/stack/boxes", "/stack/bev").for_dataset([SCENE]).scene(SCENE, STAMPS_NS)
    grid = scene.grid(1)
    assert grid is not None and grid.classes == BEV_CLASSES and scene.grid(2) is None
    np.testing.assert_array_equal(np.moveaxis(grid.scores, 0, -1), CELLS)
    assert scene.ticks_with_boxes == {2} and scene.ticks_with_grid == {1}


def test_occupancy_grids_become_layers_of_their_classes(tmp_path: Path) -> None:
    car, road = np.full((3, 4), 100, np.int8), np.zeros((3, 4), np.int8)
    road[0, 3] = 50  # ahead, right
    messages = [
        (f"{GRIDS}/car", 1, occupancy(car, int(STAMPS_NS[0]))),
        (f"{GRIDS}/road", 1, occupancy(road, int(STAMPS_NS[0]))),
        (f"{GRIDS}/car", 2, occupancy(car, int(STAMPS_NS[1]))),
    ]
    scene = read(write_bag(tmp_path / "bag", messages))
    both, one = scene.grid(0), scene.grid(1)
    assert both is not None and one is not None and one.classes == ("car",)
    assert both.classes == ("road", "car") and both.scores.shape == (2, 4, 3)
    assert both.scores[0, 0, 2] == 0.5 and both.scores[0].sum() == 0.5 and (both.scores[1] == 1).all()


def test_stamps_separate_the_scenes_of_a_bag(tmp_path: Path) -> None:
    first, second = spec(0), spec(1)
    stamps = [drawn.start_ns + drawn.tick_ns * np.arange(4) for drawn in (first, second)]
    before = [(BOXES, 1, table_message(table(1, 0), first.start_ns - first.tick_ns))]  # of the warm-up
    messages = [scene_message(0), *before, *tables([0, 1], stamps[0]), scene_message(1), *tables([2, 3], stamps[1])]
    predicted = open_predictions(write_bag(tmp_path / "live", messages)).for_dataset([first.name, second.name])
    assert predicted.scenes == (first.name, second.name)
    found = [predicted.scene(name, each) for name, each in zip(predicted.scenes, stamps, strict=True)]
    assert [sorted(scene.ticks_with_boxes) for scene in found] == [[0, 1], [2, 3]]
    assert [len(scene.boxes()) for scene in found] == [1, 5]


def test_a_folder_of_bags_and_a_dataset_with_predictions_in_its_bags(tmp_path: Path) -> None:
    for folder in (tmp_path / "answers", tmp_path / "dataset" / "scenes" / "train"):
        folder.mkdir(parents=True)
        for name in (SCENE, OTHER):
            write_bag(folder / name, tables() if name == SCENE else tables([1]))
        write_bag(folder / f"{SCENE}.more", [scene_message(0)])  # without predictions
    for path in (tmp_path / "answers", tmp_path / "dataset"):
        predicted = open_predictions(path).for_dataset([SCENE, OTHER])
        assert set(predicted.scenes) == {SCENE, OTHER}
        assert predicted.scene(OTHER, STAMPS_NS).ticks_with_boxes == {1}
        sent = pickle.loads(pickle.dumps(predicted))
        assert sent.scene(SCENE, STAMPS_NS).ticks_with_boxes == {0, 2, 3}


def test_mcap_files_in_one_folder_are_separate_bags(tmp_path: Path) -> None:
    together = tmp_path / "together"
    together.mkdir()
    for name in (SCENE, OTHER):
        next(write_bag(tmp_path / name, tables()).glob("*.mcap")).rename(together / f"{name}.mcap")
    assert open_predictions(together).scenes == (SCENE, OTHER)
    assert open_predictions(together / f"{OTHER}.mcap").scenes == (OTHER,)


def test_a_truncated_bag_gives_its_complete_messages(tmp_path: Path) -> None:
    path = write_bag(tmp_path / SCENE, tables())
    file = next(path.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[:-8])
    assert read(path).ticks_with_boxes == {0, 2, 3}


def test_missing_topics_and_wrong_types_are_named(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "a", [scene_message(0)])
    text = r"there is no topic /prediction/boxes, /prediction/bev or /prediction/bev/<class>; it has /world/scene"
    with pytest.raises(BagError, match=text):
        open_predictions(path)
    path = write_bag(tmp_path / "b", [(BOXES, 1, make("std_msgs/String", data=""))])
    with pytest.raises(InputError, match=r"/prediction/boxes: is a std_msgs/msg/String; allowed: sensor_msgs/msg/Poi"):
        open_predictions(path)


def test_unknown_stamps_and_second_answers_are_named(tmp_path: Path) -> None:
    late = [(BOXES, 1, table_message(table(1, 0), int(STAMPS_NS[1]) + 9))]
    text = r"/prediction/boxes: stamp_ns: row 0 is 3600100000009; .* nearest is 3600100000000, that of tick 1"
    with pytest.raises(InputError, match=text):
        read(write_bag(tmp_path / "a", late)).boxes()
    with pytest.raises(
        InputError, match=r"/prediction/boxes: stamp 3600150000000: two answers to tick 2; only one is allowed"
    ):
        read(write_bag(tmp_path / "b", [*tables(), *tables([2])])).boxes()


def test_two_bags_that_answer_the_same_frame_are_named(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_bag(tmp_path / name, [scene_message(0), *tables()])
    with pytest.raises(InputError, match=r"b: boxes of tick 0 of Blocks-0000 are also in .*a$"):
        read(tmp_path).boxes()


def test_errors_in_a_message_are_named_with_its_tick(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "a", [(BOXES, 1, detections([("tram", *ENTRY[1:])], header(int(STAMPS_NS[2]))))])
    with pytest.raises(InputError, match=r"a.mcap: /prediction/boxes: tick 2: class: row 0 is 'tram'"):
        read(path).boxes()
    path = write_bag(tmp_path / "b", [(GRIDS, 1, image(CELLS[..., :2], int(STAMPS_NS[2])))])
    with pytest.raises(InputError, match=r"b.mcap: /prediction/bev: tick 2: encoding: is '32FC2'; allowed: 8UC14"):
        read(path).grid(2)
    unequal = [
        (f"{GRIDS}/{name}", 1, occupancy(np.zeros((3, cells), np.int8), int(STAMPS_NS[2])))
        for name, cells in (("car", 4), ("bus", 5))
    ]
    with pytest.raises(InputError, match=r"/prediction/bev: tick 2: info: 4 x 3 of car, 5 x 3 of bus cells"):
        read(write_bag(tmp_path / "c", unequal)).grid(2)


def test_scores_in_both_forms_are_refused(tmp_path: Path) -> None:
    stamp_ns = int(STAMPS_NS[0])
    messages = [(GRIDS, 1, image(CELLS, stamp_ns)), (f"{GRIDS}/car", 1, occupancy(np.zeros((3, 4), np.int8), stamp_ns))]
    with pytest.raises(InputError, match=r"there are scores on /prediction/bev and /prediction/bev/car; only one"):
        open_predictions(write_bag(tmp_path / "a", messages))


def test_a_bag_without_scene_names_must_be_named_after_a_scene(tmp_path: Path) -> None:
    predicted = open_predictions(write_bag(tmp_path / "mine", tables()))
    assert predicted.scenes == ("mine",)
    with pytest.raises(
        InputError, match=r"mine: scene: there is no 'mine', taken from the file's name because nothing"
    ):
        predicted.for_dataset([SCENE, OTHER])
