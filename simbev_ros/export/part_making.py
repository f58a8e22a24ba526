"""Work on all parts of an export: identify them, make them in a pool, note scenes that fail, remove what is gone."""

from collections.abc import Callable, Collection, Sequence
from functools import partial
from pathlib import Path
from typing import Protocol, TypeVar

from simbev_ros import __version__
from simbev_ros.dataset import Scene
from simbev_ros.dataset.parallel import Pool
from simbev_ros.export.parts import Json, Part, fingerprint_of, part_names
from simbev_ros.foundation.errors import FOREIGN_ERRORS, BagError
from simbev_ros.foundation.object_store.object_path import require_local
from simbev_ros.recording.layout import bytes_of, mcap_files

Report = Callable[[int, int], None]
"""Called from time to time with the number of finished frames and the number of all frames to export."""

Failures = dict[str, str]
"""Reasons why scenes could not be exported, by name of the scene."""


def ignore_progress(done: int, total: int) -> None:
    """Report nothing."""


class OfScene(Protocol):
    """A part that is made from a scene."""

    @property
    def scene(self) -> Scene:
        """The scene."""


P = TypeVar("P", bound=OfScene)


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


def remove_vanished(out: Path, present: Collection[str], patterns_of: Callable[[str], tuple[str, ...] | None]) -> None:
    """Remove earlier parts without data, such as the end of a scene that is shorter now.

    Args:
        out: Folder of the export.
        present: Names of the parts that there are now.
        patterns_of: Patterns of the files of a part, by its name; None: the part stays.

    Raises:
        InputError: A file cannot be removed.
    """
    for name in part_names(out) - set(present):
        patterns = patterns_of(name)
        if patterns is not None:
            Part(out=out, name=name, identity={}, patterns=patterns).remove()


def _problem_of(make: Callable[[P], None], part: P) -> str | None:
    """Make one part; return what is wrong with the scene's bag, or None."""
    try:
        make(part)
    except BagError as error:
        return str(error)
    except FOREIGN_ERRORS as error:  # content that is not what its type says
        return f"{part.scene.path}: cannot be exported: {error!r:.200}"
    return None
