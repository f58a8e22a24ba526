"""Records the bags of the present format that a test keeps readable: ``python -m tools.format_bags OUT``.

Each YAML file next to this module becomes a dataset of one scene of a few ticks. Bags of a format are recorded once and
then stay as they are; ``test/recording/format_1/`` has those of format 1.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from simbev_ros.dataset.plan import PLAN_FILE
from simbev_ros.recording.layout import INDEX_FILE

_CONFIGURATIONS = Path(__file__).parent
_REPLAYED = "rainy_night"
"""The dataset of which ``replayed`` is a replay."""


def record_bags(out: Path) -> None:
    """Record all datasets into a folder; the maps are copied first, because bags name the paths of their files."""
    with tempfile.TemporaryDirectory(prefix="simbev-format-") as folder:
        work = Path(folder)
        for file in (*_CONFIGURATIONS.glob("*.yaml"), *_CONFIGURATIONS.glob("*.osm")):
            shutil.copy(file, work)
        for name in ("town", "several_agents", _REPLAYED, "typed"):
            _run("generate", str(work / f"{name}.yaml"), "--out", str(work / name))
        (bag,) = (work / _REPLAYED).glob("scenes/*/*")
        _run("replay", str(bag), str(work / "replayed.yaml"), "--out", str(work / "replayed"))
        for name in ("town", "several_agents", _REPLAYED, "typed", "replayed"):
            shutil.copytree(work / name / "scenes", out / name / "scenes")
        for index in (INDEX_FILE, PLAN_FILE):
            shutil.copy(work / "town" / index, out / "town")


def _run(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "simbev_ros.cli.main", *arguments], check=True)


if __name__ == "__main__":
    record_bags(Path(sys.argv[1]))
