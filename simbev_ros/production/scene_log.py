"""Log files of the scenes of a dataset: how each was made, and the output of the processes that made it."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from simbev_ros.foundation.files.confined_paths import path_inside
from simbev_ros.foundation.files.whole_files import write_errors, write_whole
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath

LOG_FOLDER, _FAILED = "logs", ".failed-"


@dataclass(frozen=True, slots=True)
class Attempt:
    """An attempt at a scene.

    Attributes:
        scene: Name of the scene, or of an additional bag of it.
        number: Number of the attempt, from 1.
        worker: The worker that makes it, for readers of the log.
        began_s: When it began, s since 1970.
    """

    scene: str
    number: int
    worker: str
    began_s: float = field(default_factory=time.time)


def write_scene_log(
    dataset: AnyPath, attempt: Attempt, summary: str, output: Mapping[str, str], *, failed: bool = False
) -> None:
    """Write ``logs/<scene>.log``, or ``logs/<scene>.failed-1.log`` if the attempt failed.

    Args:
        dataset: The dataset.
        attempt: The attempt, which has just ended.
        summary: How it ended.
        output: Output of each process, by its label.
        failed: Whether it has left no bag.

    Raises:
        DiskError: The disk is full.
        InputError: It cannot be written for another reason.
    """
    folder = _log_folder(dataset)
    name = f"{attempt.scene}{_FAILED}{attempt.number}" if failed else attempt.scene
    duration_s = time.time() - attempt.began_s
    began = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(attempt.began_s))
    by = f" on {attempt.worker}" if attempt.worker else ""
    lines = [f"{attempt.scene}, attempt {attempt.number}{by}, began {began}, took {duration_s:.1f} s", summary]
    for process, text in output.items():
        lines += [f"--- {process}", text.rstrip()] if text.strip() else []
    with write_errors(folder):
        write_whole(folder / f"{name}.log", ("\n".join(lines) + "\n").encode())


def scene_logs(dataset: AnyPath, scene: str) -> list[AnyPath]:
    """Logs of the attempts at a scene, the failed ones first, in their order; then those of its additional bags."""
    found: list[AnyPath] = [*_log_folder(dataset).glob(f"{scene}.*log")]

    def place(path: AnyPath) -> tuple[str, bool, int, str]:
        label, is_failed, number = path.stem.removeprefix(scene).partition(_FAILED)
        return label, not is_failed, len(number), number

    return sorted(found, key=place)


def _log_folder(dataset: AnyPath) -> AnyPath:
    return dataset / LOG_FOLDER if isinstance(dataset, ObjectPath) else path_inside(dataset, LOG_FOLDER)
