"""``simbev gallery`` as a user runs it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import pytest

Refused = Callable[..., str]


@pytest.mark.parametrize("size", ["big", "1600", "1600x", "100x90", "1600x9000", "-160x-90"])
def test_a_size_that_cannot_be_is_refused(refused: Refused, tmp_path: Path, size: str) -> None:
    message = refused("gallery", "--out", tmp_path / "out", f"--size={size}")
    assert f"--size {size}: must be WIDTHxHEIGHT in pixels, each from 160 to 8192" in message
    assert not (tmp_path / "out").exists()


def test_a_map_that_is_not_there_is_refused(refused: Refused, tmp_path: Path) -> None:
    assert "Town99" in refused("gallery", "--out", tmp_path / "out", "--map", "Town99")
    assert not (tmp_path / "out").exists()


def test_pictures_that_are_there_are_kept(refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "weathers").mkdir()
    message = refused("gallery", "--out", tmp_path, "--map", "Blocks")
    assert f"{tmp_path / 'weathers'}: exists already; nothing was overwritten" in message


@pytest.mark.gl
@pytest.mark.slow
def test_a_gallery_has_all_pictures_and_is_the_same_every_time(simbev: Any, tmp_path: Path) -> None:
    contents = []
    for folder in (tmp_path / "a", tmp_path / "b"):
        answer = simbev(
            "gallery",
            "--out",
            folder,
            "--map",
            "Blocks",
            "--map",
            "Town01",
            "--size",
            "320x180",
            "--quality",
            "low",
        )
        assert answer.code == 0, answer.err
        contents.append({path.relative_to(folder): path.read_bytes() for path in folder.rglob("*.jpg")})
    assert contents[0] == contents[1]
    names = {str(path) for path in contents[0]}
    assert len(names) == 3 + 2 + 7 + 5
    assert {"towns.jpg", "weathers.jpg", "modalities.jpg", "towns/Town01.jpg", "weathers/night_rain.jpg"} < names
    assert cv2.imread(str(tmp_path / "a" / "modalities" / "depth.jpg")).shape == (180, 320, 3)
    assert cv2.imread(str(tmp_path / "a" / "weathers.jpg")).shape[1] == 1920
