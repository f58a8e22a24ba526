"""An export that several tests look at."""

from pathlib import Path

import pytest
from made_up_scene import made_up_scene
from nuscenes_tables import export


@pytest.fixture(scope="session")
def nuscenes_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of two scenes, and its export."""
    folder = tmp_path_factory.mktemp("nuscenes")
    made_up_scene(folder / "set/scenes/train/Blocks-0000", ticks=23)
    made_up_scene(folder / "set/scenes/val/Blocks-0001", number=1, split="val", ticks=12)
    export(folder / "set", folder / "out")
    return folder
