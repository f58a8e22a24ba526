"""Files of bird's-eye-view scores: their content, and every documented error."""

from pathlib import Path

import numpy as np
import pytest
from prediction_data import OTHER, SCENE, STAMPS_NS

from simbev_ros.evaluation.predictions.dataset_predictions import PredictedScene, open_predictions, write_grid
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray

ALL = np.random.default_rng(2).random((len(BEV_CLASSES), 4, 3))


def read(path: Path) -> PredictedScene:
    return open_predictions(path).for_dataset([SCENE, OTHER]).scene(SCENE, STAMPS_NS)


def save(path: Path, name: str = "000002.npz", **arrays: AnyArray) -> Path:
    folder = path / "grids" / SCENE
    folder.mkdir(parents=True, exist_ok=True)
    np.savez(folder / name, **arrays)
    return path


def test_grids_are_read_frame_by_frame(tmp_path: Path) -> None:
    save(tmp_path, scores=ALL)
    save(tmp_path, "000000.npz", scores=np.full((2, 4, 3), 128, np.uint8), classes=np.array(["car", "road"]))
    scene = read(tmp_path)
    assert scene.ticks_with_grid == {0, 2} and not scene.ticks_with_boxes
    first, third = scene.grid(0), scene.grid(2)
    assert first is not None and third is not None and scene.grid(1) is None
    assert first.classes == ("car", "road") and first.scores.dtype == np.uint8
    assert third.classes == BEV_CLASSES
    np.testing.assert_array_equal(third.scores, ALL)


def test_written_grids_are_read_back(tmp_path: Path) -> None:
    write_grid(tmp_path, OTHER, 3, ALL[:1].astype(np.float16), ("bus",))
    grid = open_predictions(tmp_path).scene(OTHER, STAMPS_NS).grid(3)
    assert grid is not None and grid.classes == ("bus",)
    np.testing.assert_array_equal(grid.scores, ALL[:1].astype(np.float16))
    with pytest.raises(InputError, match=r"scores: have the shape \(1, 4, 3\); it must be \(14, rows, columns\)"):
        write_grid(tmp_path, OTHER, 3, ALL[:1])


def test_a_shape_that_differs_from_the_truth_is_named(tmp_path: Path) -> None:
    grid = read(save(tmp_path, scores=ALL)).grid(2)
    assert grid is not None
    grid.require_shape(4, 3)
    with pytest.raises(InputError, match=r"000002.npz: scores: have 4 x 3 cells; the truth has 3 x 4"):
        grid.require_shape(3, 4)


def with_value(value: float) -> AnyArray:
    scores = ALL.copy()
    scores[7, 3, 1] = value
    return scores


BAD: list[tuple[dict[str, AnyArray], str]] = [
    ({"scores": ALL[:3]}, r"scores: have the shape \(3, 4, 3\); it must be \(14, rows, columns\), one layer a class"),
    ({"scores": ALL[0]}, r"scores: have the shape \(4, 3\)"),
    ({"scores": ALL[:1], "classes": np.array(["tram"])}, r"classes: there is no 'tram'; allowed: road, hazard"),
    ({"scores": ALL[:2], "classes": np.array(["car", "car"])}, r"classes: car, car: each is allowed once"),
    ({"scores": with_value(np.nan)}, r"scores: car at row 3, column 1 is nan; allowed: 0 to 1"),
    ({"scores": with_value(1.5)}, r"scores: car at row 3, column 1 is 1.5; allowed: 0 to 1"),
    ({"scores": with_value(-0.1)}, r"scores: car at row 3, column 1 is -0.1; allowed: 0 to 1"),
    ({"scores": ALL.astype(np.int64)}, r"scores: are of the type int64; allowed: floating and uint8"),
    ({"labels": ALL}, r"there is no array 'scores', but labels"),
    ({"scores": np.array([{}], object)}, r"scores: cannot be read as NPZ: it holds Python objects"),
]


@pytest.mark.parametrize(("arrays", "message"), BAD)
def test_bad_scores_are_named(tmp_path: Path, arrays: dict[str, AnyArray], message: str) -> None:
    with pytest.raises(InputError, match=rf"000002.npz: {message}"):
        read(save(tmp_path, **arrays)).grid(2)


@pytest.mark.parametrize("name", ["000004.npz", "2.npz", "frame.npz"])
def test_a_file_whose_name_is_no_tick_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=rf"{name}: its name must be the tick: .*, 000000.npz to 000003.npz"):
        _ = read(save(tmp_path, name, scores=ALL)).ticks_with_grid


def test_a_folder_of_an_unknown_scene_is_named(tmp_path: Path) -> None:
    save(tmp_path, scores=ALL)
    with pytest.raises(InputError, match=r"grids: scene: there is no 'Blocks-0000'; the dataset has Blocks-0001"):
        open_predictions(tmp_path).for_dataset([OTHER])


def test_a_truncated_file_raises_input_error(tmp_path: Path) -> None:
    file = save(tmp_path, scores=ALL) / "grids" / SCENE / "000002.npz"
    file.write_bytes(file.read_bytes()[:300])
    with pytest.raises(InputError, match=r"000002.npz: cannot be read as NPZ"):
        read(tmp_path).grid(2)
