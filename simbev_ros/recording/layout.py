"""Where things lie: the folder of a scene's bag, its unfinished form, its attachments, and a dataset of scenes."""

from pathlib import Path

from simbev_ros.errors import BagError

PARTIAL_SUFFIX = ".partial"
SCENE_ATTACHMENT = "scene.json"
CONFIG_ATTACHMENT = "config.yaml"
MAP_ATTACHMENT = "map.xodr"
MAP_SOURCE_ATTACHMENT = "map_source.gz"
"""The file that the map was made from, for maps that are files."""
LEAD_IN_ATTACHMENT = "lead_in.json"
TRAJECTORIES_ATTACHMENT = "trajectories.npz"
"""Where every actor has gone: ``annotation/trajectories.py``."""
METADATA_FILE = "metadata.yaml"


def partial_of(bag: Path) -> Path:
    """The folder that a bag is written to until it is finished."""
    return bag.with_name(bag.name + PARTIAL_SUFFIX)


def mcap_in(bag: Path, name: str) -> Path:
    """The MCAP file of the scene called ``name`` in a bag folder, finished or not."""
    return bag / f"{name}_0.mcap"


def locate_mcap(path: Path) -> Path:
    """The one MCAP file that ``path``, a bag folder or the file itself, stands for.

    Raises:
        BagError: There is nothing at this path, or not exactly one MCAP file.
    """
    if not path.exists():
        raise BagError(f"{path}: no such file or folder")
    if path.is_file():
        return path
    files = sorted(path.glob("*.mcap"))
    if len(files) != 1:
        raise BagError(f"{path}: a scene's bag holds one .mcap file, this folder holds {len(files)}")
    return files[0]


def scene_folder(dataset: Path, split: str, name: str) -> Path:
    """The folder of a scene's finished bag in a dataset."""
    return dataset / "scenes" / split / name


def is_dataset(path: Path) -> bool:
    """Whether a path is a dataset's folder."""
    return (path / "scenes").is_dir()


def scenes_of(dataset: Path) -> list[Path]:
    """The bags of a dataset, finished and unfinished, as ``scenes/<split>/<scene>``, in order of name."""
    return sorted(path.parent for path in (dataset / "scenes").glob("*/*/*.mcap"))
