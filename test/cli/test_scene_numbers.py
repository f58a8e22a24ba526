"""The numbers of scenes that ``simbev generate --replace`` takes."""

from collections.abc import Callable
from pathlib import Path

import pytest

from simbev_ros.cli.scene_numbers import scene_numbers
from simbev_ros.foundation.errors import InputError


@pytest.mark.parametrize(("words", "numbers"), [(["3", "17-20"], [3, 17, 18, 19, 20]), (["3, 5", "5-5"], [3, 5, 5])])
def test_numbers_and_ranges(words: list[str], numbers: list[int]) -> None:
    assert [number for each in scene_numbers("--replace", words) for number in each] == numbers


@pytest.mark.parametrize("word", ["x", "", "5-3", "-1", "1.5"])
def test_a_word_that_is_no_number_is_refused(word: str) -> None:
    with pytest.raises(InputError, match=r"^--replace: "):
        scene_numbers("--replace", [word])


def test_the_command_names_the_option_whose_number_has_no_scene(refused: Callable[..., str], tmp_path: Path) -> None:
    config = tmp_path / "config.yaml"
    config.write_text("scenes: [{map: Blocks, train: 2}]\nrig: {sensors: []}\n")
    error = refused("generate", config, "--out", tmp_path / "set", "--replace", "0,7")
    assert error == "error: --replace: the dataset has no scene 7; its numbers are 0 to 1\n"
