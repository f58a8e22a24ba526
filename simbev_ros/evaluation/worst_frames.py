"""Selects the frames with the worst predictions, for the pictures of the report.

From the evaluated frames of all scenes, a short list of those that miss most boxes, or have the lowest IoU, is made.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple

from simbev_ros.foundation.types import Table


class WorstFrame(NamedTuple):
    """A frame with poor predictions.

    Attributes:
        scene: Name of the scene.
        tick: Tick of the frame.
        boxes: Number of ground-truth boxes that count.
        found: Number of those that were found.
        iou: Mean IoU over the classes of cells; NaN if there is none.
    """

    scene: str
    tick: int
    boxes: int
    found: int
    iou: float


def worst_frames(frames: Mapping[str, Table], count: int, min_gap_ticks: Callable[[str], int]) -> list[WorstFrame]:
    """Answered frames that miss the most boxes.

    Ties are broken by the smaller share of found boxes, then by the order of scenes and ticks.

    Args:
        frames: ``scene_evaluation.FRAME_DTYPE`` of each scene, by name.
        count: Maximum number of frames to return.
        min_gap_ticks: Minimum distance between two returned frames of a scene, by its name, as neighbors look alike.
    """
    candidates = [each for each in _answered(frames, "answered_boxes") if each.found < each.boxes]
    candidates.sort(key=lambda each: (each.found - each.boxes, each.found / each.boxes, each.scene, each.tick))
    return _keep_spaced(candidates, count, min_gap_ticks)


def worst_grids(frames: Mapping[str, Table], count: int, min_gap_ticks: Callable[[str], int]) -> list[WorstFrame]:
    """Answered frames with the lowest mean IoU, ties in the order of scenes and ticks.

    The arguments are those of ``worst_frames``.
    """
    candidates = [each for each in _answered(frames, "answered_grid") if each.iou < 1]
    candidates.sort(key=lambda each: (each.iou, each.scene, each.tick))
    return _keep_spaced(candidates, count, min_gap_ticks)


def _answered(frames: Mapping[str, Table], column: str) -> Iterator[WorstFrame]:
    for scene, table in frames.items():
        chosen = table[list(WorstFrame._fields[1:])][table[column]]
        yield from (WorstFrame(scene, *row) for row in chosen.tolist())


def _keep_spaced(ranked: Iterable[WorstFrame], count: int, min_gap_ticks: Callable[[str], int]) -> list[WorstFrame]:
    """The first frames of a ranking that keep the minimum gap to those already chosen."""
    found: list[WorstFrame] = []
    for each in ranked:
        if len(found) == count:
            break
        if all(
            each.scene != other.scene or abs(each.tick - other.tick) >= min_gap_ticks(each.scene) for other in found
        ):
            found.append(each)
    return found
