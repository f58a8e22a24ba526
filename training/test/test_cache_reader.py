"""Reading of cached samples: sweeps are moved by the ego's motion, projections find what they should."""

from pathlib import Path

import numpy as np
import pytest
from cached_scene import CAR, WIDTH_PX, write_cached_scene

from simbev_ros.foundation.errors import InputError
from simbev_training.cache.layout import KINDS
from simbev_training.cache.reader import CachedScene, cached_scenes

AGES_NS = (0, 250_000_000, 500_000_000)


def test_earlier_sweeps_are_where_the_ego_was(tmp_path: Path) -> None:
    points = CachedScene(write_cached_scene(tmp_path)).sample(1, AGES_NS).points()
    newest, earlier = (points[points[:, 3] == sweep, :3] for sweep in (0, 1))
    assert np.allclose(newest - earlier, [5.0, 0.0, 0.0], atol=1e-5)  # it drove 5 m ahead


def test_the_first_frame_has_only_its_own_sweep(tmp_path: Path) -> None:
    assert set(CachedScene(write_cached_scene(tmp_path)).sample(0, AGES_NS).points()[:, 3]) == {0.0}


def test_boxes_and_images_belong_to_their_frame(tmp_path: Path) -> None:
    sample = CachedScene(write_cached_scene(tmp_path, frames=3)).sample(2, AGES_NS)
    assert len(sample.boxes) == 2
    assert len(sample.jpegs) == 6
    assert all(bytes(jpeg[:2]) == b"\xff\xd8" and bytes(jpeg[-2:]) == b"\xff\xd9" for jpeg in sample.jpegs)


def test_a_projection_leads_to_the_column_of_the_direction(tmp_path: Path) -> None:
    u, _, depth_m = CachedScene(write_cached_scene(tmp_path)).sample(0, AGES_NS).pixel_from_level[0] @ [*CAR, 1.0]
    assert depth_m == pytest.approx(CAR[0])
    assert u / depth_m == pytest.approx(WIDTH_PX / 2 - 0.5 - 40.0 * CAR[1] / CAR[0])


def test_scenes_come_by_number(tmp_path: Path) -> None:
    for name in ("Town01-0010", "Town12-0009", "Town02-0100"):
        write_cached_scene(tmp_path, name=name)
    (tmp_path / "train" / ".Town05-0000").mkdir()
    assert [each.folder.name[-4:] for each in cached_scenes(tmp_path, "train")] == ["0009", "0010", "0100"]


def test_a_split_without_scenes_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no scenes of the split val"):
        cached_scenes(tmp_path, "val")


def test_a_cache_of_another_version_is_refused(tmp_path: Path) -> None:
    folder = write_cached_scene(tmp_path)
    (folder / "scene.json").write_text('{"format": 99}', encoding="utf-8")
    with pytest.raises(InputError, match=r"scene\.json: format: 99; this version reads 3"):
        _ = CachedScene(folder).about


@pytest.mark.parametrize("content", ["[]", "[" * 100_000, "{", '{"format": 3}'], ids=["list", "deep", "cut", "short"])
def test_damaged_facts_about_a_scene_are_named(tmp_path: Path, content: str) -> None:
    folder = write_cached_scene(tmp_path)
    (folder / "scene.json").write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=r"scene\.json: (cannot be read: |it is nested too deeply)"):
        _ = CachedScene(folder).about


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("damage", ["bytes", "axes", "rows"])
def test_a_damaged_array_is_named(tmp_path: Path, name: str, damage: str) -> None:
    folder = write_cached_scene(tmp_path)
    file = folder / f"{name}.npy"
    if damage == "bytes":
        file.write_bytes(b"nothing")
    else:
        np.save(file, np.float32(3.0) if damage == "axes" else np.load(file)[:-1])
    with pytest.raises(InputError, match=rf"{folder}({file.name})?.*: cannot be read"):
        CachedScene(folder).sample(0, AGES_NS)


def test_a_damaged_image_is_named(tmp_path: Path) -> None:
    folder = write_cached_scene(tmp_path)
    np.save(folder / "images.npy", np.zeros_like(np.load(folder / "images.npy")))
    with pytest.raises(InputError, match=r"an image of the cache: cannot be read: "):
        CachedScene(folder).sample(0, AGES_NS).images()


def test_a_scene_without_a_number_is_refused(tmp_path: Path) -> None:
    write_cached_scene(tmp_path, name="Plain")
    with pytest.raises(InputError, match=r"train: names of scenes: cannot be read: "):
        cached_scenes(tmp_path, "train")
