"""Statistics equal counts from plain loops over all boxes, cells and frames."""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_scene import SENSORS, MadeUp, labeled_at, made_up_scene, made_up_spec, record_made_up

from simbev_ros.dataset import open_dataset
from simbev_ros.dataset import statistics as statistics_module
from simbev_ros.dataset.parallel import Processes
from simbev_ros.dataset.statistics import Statistics, statistics_of
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import Table
from simbev_ros.scene.legend import legend
from simbev_ros.show.pages.scene_figures import key_figures


@pytest.fixture(scope="module")
def counted(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[MadeUp], Statistics]:
    folder = tmp_path_factory.mktemp("set")
    scenes = [
        made_up_scene(folder / "scenes/train/Blocks-0000", ticks=60),
        made_up_scene(folder / "scenes/val/Blocks-0001", number=1, split="val", ticks=5),
    ]
    return scenes, statistics_of(open_dataset(folder), Processes(2))


def all_boxes(scenes: list[MadeUp]) -> list[Table]:
    return [row for scene in scenes for tick in scene.ticks for row in tick["boxes"]]


def assert_counts(counts: Any, expected: Counter[Any]) -> None:
    assert {tuple(index): counts[tuple(index)] for index in np.argwhere(counts)} == dict(expected)


def test_boxes_by_class_distance_speed_and_size(counted: tuple[list[MadeUp], Statistics]) -> None:
    scenes, statistics = counted
    counts, rows = statistics.tally.counts, all_boxes(scenes)
    assert statistics.tally.frames == 65 and len(rows) == 65 * 12
    assert_counts(counts["boxes"], Counter((row["class"],) for row in rows))
    assert_counts(counts["valid"], Counter((row["class"],) for row in rows if row["valid"]))
    assert_counts(counts["distance"], Counter((row["class"], int(row["distance"] // 5)) for row in rows))
    speeds = [float(row["vx"]) ** 2 + float(row["vy"]) ** 2 + float(row["vz"]) ** 2 for row in rows]
    assert_counts(counts["speed"], Counter((row["class"], int(v**0.5)) for row, v in zip(rows, speeds, strict=True)))
    sizes = Counter(
        (axis, row["class"], int(float(row[name]) / 0.25))
        for row in rows
        for axis, name in enumerate(("length", "width", "height"))
    )
    assert_counts(counts["size"], sizes)
    assert_counts(counts["difficulty"], Counter((row["class"], row["difficulty"]) for row in rows))


def test_boxes_of_a_frame(counted: tuple[list[MadeUp], Statistics]) -> None:
    scenes, statistics = counted
    expected: Counter[Any] = Counter()
    for scene in scenes:
        for tick in scene.ticks:
            expected.update((c, int((tick["boxes"]["class"] == c).sum())) for c in range(10))
    assert_counts(statistics.tally.counts["per_frame"], expected)
    assert_counts(statistics.tally.counts["all_per_frame"], Counter({(12,): 65}))


def test_visibility_and_points(counted: tuple[list[MadeUp], Statistics]) -> None:
    scenes, statistics = counted
    counts, rows = statistics.tally.counts, all_boxes(scenes)
    seen = [row for row in rows if row["visibility"] == row["visibility"]]
    assert_counts(counts["visibility"], Counter((row["class"], int(float(row["visibility"]) * 20)) for row in seen))
    assert counts["unseen"].sum() == len(rows) - len(seen) > 0
    known = [row for row in rows if row["lidar_points"] >= 0]
    assert counts["lidar_boxes"].sum() == len(known) < len(rows)
    points: Counter[Any] = Counter()
    for row in known:
        points[row["class"], int(row["distance"] // 5)] += int(row["lidar_points"])
    assert_counts(counts["lidar_points"], Counter({index: n for index, n in points.items() if n}))
    levels = Counter((int(row["distance"] // 5), int(row["lidar_points"]).bit_length()) for row in known)
    assert_counts(counts["lidar_levels"], levels)


def test_positions_have_the_axes_of_the_birds_eye_view(counted: tuple[list[MadeUp], Statistics]) -> None:
    scenes, statistics = counted
    expected: Counter[Any] = Counter()
    for row in all_boxes(scenes):
        ahead_m = float(row["distance"]) * np.cos(float(row["angle"]))
        left_m = float(row["distance"]) * np.sin(float(row["angle"]))
        if abs(ahead_m) < 120 and abs(left_m) < 120:
            expected[row["class"], int((120 - ahead_m) // 4), int((120 - left_m) // 4)] += 1
    assert_counts(statistics.tally.counts["places"], expected)


def test_cells_of_the_grid(counted: tuple[list[MadeUp], Statistics]) -> None:
    scenes, statistics = counted
    grids = [tick["bev/labels"] for scene in scenes for tick in scene.ticks]
    bev = statistics.tally.bev
    assert bev is not None and bev.shape == (14, 20, 24) and statistics.tally.counts["bev_frames"] == 65
    for index in range(14):
        np.testing.assert_array_equal(bev[index], sum((grid >> index & 1).astype(int) for grid in grids))
        assert statistics.tally.counts["bev_present"][index] == sum((grid >> index & 1).any() for grid in grids)


def test_actors_distances_and_settings(counted: tuple[list[MadeUp], Statistics]) -> None:
    scenes, statistics = counted
    blueprints = legend()["blueprints"]
    firsts = [scene.ticks[0]["world/actors"]["blueprint"] for scene in scenes]
    assert statistics.tally.actors == Counter(blueprints[index]["name"] for first in firsts for index in first)
    cells = {
        (int(row["x"] // 4), int(row["y"] // 4))
        for scene in scenes
        for tick in scene.ticks
        for row in tick["world/actors"]
        if row["id"] != 1
    }
    assert {tuple(cell) for cell in statistics.visited["Blocks"].tolist()} == cells
    assert [scene.distance_m for scene in statistics.scenes] == pytest.approx([59 * 5.0, 4 * 5.0])
    assert [scene.boxes for scene in statistics.scenes] == [60 * 12, 5 * 12]
    assert [scene.split for scene in statistics.scenes] == ["train", "val"]
    assert [scene.vehicles for scene in statistics.scenes] == [2, 3]


def test_of_many_frames_only_every_nth_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(statistics_module, "MAX_FRAMES", 10)
    scene = made_up_scene(tmp_path / "Blocks-0000", ticks=31)
    statistics = statistics_of(open_dataset(tmp_path / "Blocks-0000"))
    assert statistics.every == 3 and statistics.tally.frames == 11
    expected = Counter((row["class"],) for tick in scene.ticks[::3] for row in tick["boxes"])
    assert_counts(statistics.tally.counts["boxes"], expected)


def test_an_empty_dataset_is_refused(tmp_path: Path) -> None:
    (tmp_path / "scenes").mkdir()
    with pytest.raises(InputError, match="it has no finished scene"):
        statistics_of(open_dataset(tmp_path))


def test_two_scenes_with_the_same_name_are_both_counted(tmp_path: Path) -> None:
    for split, ticks in (("train", 5), ("val", 3)):
        made_up_scene(tmp_path / "scenes" / split / "Blocks-0000", split=split, ticks=ticks)
    statistics = statistics_of(open_dataset(tmp_path), Processes(2))
    assert [scene.labeled_frames for scene in statistics.scenes] == [5, 3] and statistics.tally.frames == 8


def test_frames_without_labels_do_not_count_as_frames_without_boxes(tmp_path: Path) -> None:
    spec = labeled_at(made_up_spec(SENSORS, ticks=12), 4)
    record_made_up(tmp_path / "scenes/train/Blocks-0000", spec)
    statistics = statistics_of(open_dataset(tmp_path))
    (facts,) = statistics.scenes
    assert (statistics.tally.frames, statistics.tally.labeled_frames, facts.labeled_frames) == (12, 3, 3)
    assert np.flatnonzero(facts.moments["labeled"]).tolist() == [0, 5, 10]
    assert facts.boxes == 3 * 12 and ("12", "boxes a frame") in key_figures(statistics)


@pytest.mark.parametrize(("max_frames", "every", "labeled"), [(24, 1, 5), (3, 5, 5), (2, 10, 3)])
def test_sampled_frames_have_labels(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, max_frames: int, every: int, labeled: int
) -> None:
    spec = labeled_at(made_up_spec(SENSORS, ticks=24), 4)
    record_made_up(tmp_path / "scenes/train/Blocks-0000", spec)
    monkeypatch.setattr(statistics_module, "MAX_FRAMES", max_frames)
    statistics = statistics_of(open_dataset(tmp_path))
    assert (statistics.every, statistics.tally.labeled_frames) == (every, labeled)
