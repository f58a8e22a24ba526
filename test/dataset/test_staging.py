"""A replaced scene is removed with its additional bags; after an interruption either it or its replacement exists."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.dataset.staging import clean_up_staging, move_into_dataset, staging_of

ENTRY = PlannedEntry(number=1, map="Blocks", split="train")
KEPT = {"Blocks-0000": "0", "Blocks-0000.rear": "0", "Blocks-00010": "10", "Blocks-00010.rear": "10"}
OLD = {"Blocks-0001": "old", "Blocks-0001.rear": "old", "Blocks-0001.night": "old", **KEPT}
NEW = {"Blocks-0001": "new", **KEPT}


def bags(dataset: Path) -> dict[str, str]:
    return {file.parent.name: file.read_text() for file in (dataset / "scenes/train").rglob("*.mcap")}


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """Three scenes with additional bags, and a replacement for one of them."""
    contents = {tmp_path / "scenes/train" / name: text for name, text in OLD.items()}
    contents[staging_of(tmp_path) / "scenes/train/Blocks-0001"] = "new"
    for folder, text in contents.items():
        folder.mkdir(parents=True)
        (folder / f"{folder.name}_0.mcap").write_text(text)
    return tmp_path


def test_a_replaced_scene_is_removed_with_its_own_additional_bags_only(dataset: Path) -> None:
    move_into_dataset(dataset, ENTRY, staging_of(dataset))
    assert bags(dataset) == NEW
    assert {folder.name for folder in (dataset / "scenes/train").iterdir()} == NEW.keys()


@pytest.mark.parametrize("steps", range(6))
def test_an_interruption_after_any_step_leaves_the_old_or_the_new_scene(
    steps: int, dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = 0

    def interrupting(step: Callable[..., object]) -> Callable[..., object]:
        def interrupt(*arguments: object, **options: object) -> object:
            nonlocal done
            if done == steps:
                raise KeyboardInterrupt
            done += 1
            return step(*arguments, **options)

        return interrupt

    monkeypatch.setattr(Path, "rename", interrupting(Path.rename))
    monkeypatch.setattr(shutil, "rmtree", interrupting(shutil.rmtree))
    if steps < 5:  # three of the old scene's bags, the new one, and the removal
        with pytest.raises(KeyboardInterrupt):
            move_into_dataset(dataset, ENTRY, staging_of(dataset))
    else:
        move_into_dataset(dataset, ENTRY, staging_of(dataset))
    monkeypatch.undo()
    clean_up_staging(dataset)
    assert bags(dataset) == (OLD if steps < 4 else NEW)
    assert {folder.name for folder in (dataset / "scenes/train").iterdir()} == bags(dataset).keys()


def test_scenes_are_never_recorded_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    staging_of(tmp_path).symlink_to(tmp_path / "elsewhere")
    clean_up_staging(tmp_path)
    assert not staging_of(tmp_path).is_symlink() and (tmp_path / "elsewhere").is_dir()
