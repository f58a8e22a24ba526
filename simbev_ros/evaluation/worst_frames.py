"""The frames that predictions answer worst, to be looked at."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple

from simbev_ros.types import Table


class WorstFrame(NamedTuple):
    """One of them.

    Attributes:
        scene: Its name.
        tick: Of the frame.
        boxes: That count.
        found: Of them.
        iou: Mean over the classes of cells; NaN: there is none.
    """

    scene: str
    tick: int
    boxes: int
    found: int
    iou: float


def worst_frames(frames: Mapping[str, Table], count: int, apart_ticks: Callable[[str], int]) -> list[WorstFrame]:
    """Those with an answer that miss most boxes; of as many, those that find the smaller share, then the earlier ones.

    Args:
        frames: By scene, ``scene_evaluation.FRAME_DTYPE``.
        count: At most so many.
        apart_ticks: How far apart two frames of a scene are at least, by its name, as next ones look alike.
    """
    candidates = [each for each in _answered(frames, "answered_boxes") if each.found < each.boxes]
    candidates.sort(key=lambda each: (each.found - each.boxes, each.found / each.boxes, each.scene, each.tick))
    return _apart(candidates, count, apart_ticks)


def worst_grids(frames: Mapping[str, Table], count: int, apart_ticks: Callable[[str], int]) -> list[WorstFrame]:
    """Those with an answer whose mean IoU is least, then the earlier ones; arguments as of ``worst_frames``."""
    candidates = [each for each in _answered(frames, "answered_grid") if each.iou < 1]
    candidates.sort(key=lambda each: (each.iou, each.scene, each.tick))
    return _apart(candidates, count, apart_ticks)


def _answered(frames: Mapping[str, Table], column: str) -> Iterator[WorstFrame]:
    for scene, table in frames.items():
        chosen = table[list(WorstFrame._fields[1:])][table[column]]
        yield from (WorstFrame(scene, *row) for row in chosen.tolist())


def _apart(ranked: Iterable[WorstFrame], count: int, apart_ticks: Callable[[str], int]) -> list[WorstFrame]:
    """The first that are far enough from those before them."""
    found: list[WorstFrame] = []
    for each in ranked:
        if len(found) == count:
            break
        if all(each.scene != other.scene or abs(each.tick - other.tick) >= apart_ticks(each.scene) for other in found):
            found.append(each)
    return found
