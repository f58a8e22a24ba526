"""Parts of exports that are made from scenes: identify them, make them in a pool, note scenes that fail."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from simbev_ros import __version__
from simbev_ros.dataset import Scene
from simbev_ros.dataset.parallel import Pool
from simbev_ros.export.parts import Json, Part, fingerprint_of
from simbev_ros.foundation.errors import FOREIGN_ERRORS, BagError
from simbev_ros.foundation.object_store.object_path import require_local
from simbev_ros.recording.layout import bytes_of, mcap_files

Report = Callable[[int, int], None]
"""Called from time to time with the number of finished frames and the number of all frames to export."""

Failures = dict[str, str]
"""Reasons why scenes could not be exported, by name of the scene."""


def ignore_progress(done: int, total: int) -> None:
    """Report nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PartOfScene(Part):
    """A part that is made from a scene. Exporters add what they need besides in a subclass.

    Attributes:
        scene: The scene.
    """

    scene: Scene


P = TypeVar("P", bound=PartOfScene)


def source_of(scene: Scene) -> Json:
    """Fingerprint of a scene's bags, its agent, and the version of simbev_ros, for the identity of parts."""
    bag = require_local(scene.path)
    newest_ns = max(file.stat().st_mtime_ns for file in mcap_files(bag))
    own = {"bytes": bytes_of(bag), "mtime_ns": newest_ns}
    additional = [fingerprint_of(require_local(each)) for each in scene.additional.values()]
    agent = {} if scene.chosen_agent is None else {"agent": scene.chosen_agent}
    return {**own, **({"additional": additional} if additional else {}), **agent, "by": __version__}


def make_parts(
    make: Callable[[P], None], parts: Sequence[P], pool: Pool, report: Report = ignore_progress, frames: int = 0
) -> Failures:
    """Make parts in parallel.

    Args:
        make: Makes one part, in any process.
        parts: The parts, of which none is finished.
        pool: Workers that make them.
        report: Receives the progress.
        frames: Number of frames of all parts.

    Raises:
        InputError: A file cannot be written.
        SimbevError: A process was killed.
    """
    report(0, frames)
    problems = list(pool.map(partial(_problem_of, make), parts, lambda done: report(done, frames)))
    report(frames, frames)
    return {part.scene.name: problem for part, problem in zip(parts, problems, strict=True) if problem is not None}


def make_missing(
    make: Callable[[P], None], parts: Sequence[P], pool: Pool, report: Report, frames_of: Callable[[P], int]
) -> tuple[list[P], Failures]:
    """Make the parts that are not finished, and remove what those of failed scenes have left; the folder is held.

    Args:
        make: Makes one part, in any process.
        parts: All parts of the export.
        pool: Workers that make them.
        report: Receives the progress.
        frames_of: Returns the number of frames of a part.

    Returns:
        The parts that were not finished, and the failures.

    Raises:
        InputError: A file cannot be written or removed.
        SimbevError: A process was killed.
    """
    missing = unfinished(parts)
    failures = make_parts(make, missing, pool, report, sum(map(frames_of, missing)))
    for part in parts:
        part.remove() if part.scene.name in failures else part.tidy_up()
    return missing, failures


def unfinished(parts: Sequence[P]) -> list[P]:
    """The parts that are not finished, or outdated."""
    return [part for part in parts if part.record() is None]


def without(parts: Sequence[P], failures: Failures) -> list[P]:
    """The parts of scenes that could be exported."""
    return [part for part in parts if part.scene.name not in failures]


def frame_count(part: PartOfScene) -> int:
    """Number of frames of the scene; 0 for a damaged one, which is reported when it is exported."""
    try:
        return len(part.scene)
    except BagError:
        return 0


def _problem_of(make: Callable[[P], None], part: P) -> str | None:
    """Make one part; return what is wrong with the scene's bag, or None."""
    try:
        make(part)
    except BagError as error:
        return str(error)
    except FOREIGN_ERRORS as error:  # content that is not what its type says
        return f"{part.scene.path}: cannot be exported: {error!r:.200}"
    return None
