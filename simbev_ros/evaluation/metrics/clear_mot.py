"""Tracking metrics of nuScenes, as nuscenes-devkit 1.2.0 computes them from tracks: AMOTA, AMOTP and CLEAR MOT.

Sources: Bernardin and Stiefelhagen, Evaluating Multiple Object Tracking Performance, 2008 (MOTA, MOTP); Weng et al., 3D
Multi-Object Tracking, IROS 2020 (AMOTA, AMOTP). Within each frame, an object keeps the track of its last match while
that is near enough; the others are assigned at the least sum of distances. AMOTA and AMOTP are means over 40 recalls,
each with the score that a track needs for it. The other metrics are those at the score with the highest MOTA.

Gaps in which an object or a track does not count are not filled by interpolation, which the devkit does on loading.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from simbev_ros.evaluation.metrics.tracks import MATCH_DISTANCE_M, ClassTracks, assigned
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array

_MIN_RECALL, _RECALLS = 0.1, 40
_FORBIDDEN = 1e6
"""Cost of a pair that may not match; it makes matches as many as possible."""


@dataclass(frozen=True, slots=True)
class ClearMot:
    """Metrics of one class.

    Attributes:
        amota: Mean accuracy over recalls, 0 … 1.
        amotp_m: Mean distance of matches over recalls.
        mota: Highest accuracy, 0 … 1.
        motp_m: Mean distance of matches; NaN: there is none.
        recall: Matches over ground-truth boxes.
        switches: Number of matches with another track than that of the object's last match; NaN: no recall is reached.
        fragmentations: Number of times that a tracked object is lost and found again; NaN: no recall is reached.
        min_score: Score of tracks at which ``mota`` and what follows are measured; NaN: no recall is reached.
    """

    amota: float
    amotp_m: float
    mota: float
    motp_m: float
    recall: float
    switches: float
    fragmentations: float
    min_score: float


@dataclass(frozen=True, slots=True)
class _Counts:
    """Numbers of boxes at a score."""

    truths: int
    predictions: int
    matches: int
    switches: int
    fragmentations: int
    distance_sum_m: float

    @property
    def errors(self) -> int:
        """Misses, false positives and switches."""
        found = self.matches + self.switches
        return (self.truths - found) + (self.predictions - found) + self.switches

    @property
    def mota(self) -> float:
        return max(0.0, 1.0 - self.errors / self.truths)

    @property
    def motar(self) -> float:
        """Accuracy among the boxes that are found at this recall; 0 without a match."""
        recall = self.matches / self.truths
        excess = self.errors - (1.0 - recall) * self.truths
        return max(0.0, 1.0 - excess / (recall * self.truths)) if self.matches else 0.0

    @property
    def motp_m(self) -> float:
        found = self.matches + self.switches
        return self.distance_sum_m / found if found else np.nan


def clear_mot(scenes: Sequence[ClassTracks]) -> ClearMot:
    """Metrics of one class over all scenes, which have at least one ground-truth box of it."""
    scores = _scores_of_recalls(scenes)
    known = {score: _counts(scenes, score) for score in np.unique(scores).tolist()}
    if not known:
        return ClearMot(0.0, MATCH_DISTANCE_M, 0.0, MATCH_DISTANCE_M, 0.0, np.nan, np.nan, np.nan)
    reached = [known[score] for score in scores.tolist()]
    missing = [MATCH_DISTANCE_M] * (_RECALLS - len(reached))
    best_score = max(known, key=lambda score: (known[score].mota, -score))
    best = known[best_score]
    return ClearMot(
        amota=sum(each.motar for each in reached) / _RECALLS,
        amotp_m=float(np.mean([*(np.nan_to_num(each.motp_m, nan=MATCH_DISTANCE_M) for each in reached), *missing])),
        mota=best.mota,
        motp_m=best.motp_m,
        recall=(best.matches + best.switches) / best.truths,
        switches=best.switches,
        fragmentations=best.fragmentations,
        min_score=best_score,
    )


def _scores_of_recalls(scenes: Sequence[ClassTracks]) -> Float64Array:
    """Scores that give the recalls that can be reached, of the 40 from 0.1 to 1."""
    found = [np.zeros(0)]
    for each in scenes:
        pairs, is_switch = _matches(each)
        found.append(each.score[each.pair_track[pairs[~is_switch]]])
    score = np.sort(np.concatenate(found))[::-1]
    if not len(score):
        return score
    recall = np.arange(1, len(score) + 1) / sum(len(each.object) for each in scenes)
    wanted = np.linspace(_MIN_RECALL, 1.0, _RECALLS).round(12)
    return np.interp(wanted[wanted <= recall[-1]], recall, score, right=0)


def _counts(scenes: Sequence[ClassTracks], min_score: float) -> _Counts:
    """Numbers over all scenes of the tracks with at least this score."""
    parts = [_scene_counts(each.above(min_score)) for each in scenes]
    return _Counts(*(sum(values) for values in zip(*parts, strict=True)))


def _scene_counts(tracks: ClassTracks) -> tuple[int, int, int, int, int, float]:
    """The numbers of ``_Counts`` in one scene."""
    pairs, is_switch = _matches(tracks)
    switches = int(is_switch.sum())
    return (
        len(tracks.object),
        len(tracks.track),
        len(pairs) - switches,
        switches,
        _fragmentations(tracks, tracks.truth[pairs]),
        float(tracks.distance_m[pairs].sum()),
    )


def _fragmentations(tracks: ClassTracks, matched: Int64Array) -> int:
    """Number of gaps between the matches of an object, given the indices of matched ground-truth boxes."""
    order = np.argsort(tracks.object, kind="stable")
    is_matched = np.zeros(len(order), np.bool_)
    is_matched[matched] = True
    position = np.flatnonzero(is_matched[order])
    is_same = np.diff(tracks.object[order][position]) == 0
    return int((is_same & (np.diff(position) > 1)).sum())


def _matches(tracks: ClassTracks) -> tuple[Int64Array, BoolArray]:
    """Indices of the pairs that match, frame by frame, and whether each switches the object's track."""
    last, found, switched = dict[int, int](), list[int](), list[bool]()
    objects, names = tracks.object[tracks.truth].tolist(), tracks.pair_track.tolist()
    for pairs in frames_of(tracks):
        kept, used = list[int](), set[int]()
        for pair in pairs:
            if last.get(objects[pair]) == names[pair] and names[pair] not in used:
                kept.append(pair)
                used.add(names[pair])
        done = {objects[pair] for pair in kept}
        free = [pair for pair in pairs if objects[pair] not in done and names[pair] not in used]
        new = _nearest(free, [objects[pair] for pair in free], [names[pair] for pair in free], tracks.distance_m)
        switched += [False] * len(kept) + [objects[pair] in last for pair in new]
        last |= {objects[pair]: names[pair] for pair in new}
        found += kept + new
    return np.array(found, np.int64), np.array(switched, np.bool_)


def frames_of(tracks: ClassTracks) -> Iterator[range]:
    """Ranges of the pairs of each frame that has any."""
    frame = tracks.frame[tracks.truth]
    edges = [*np.flatnonzero(np.diff(frame, prepend=frame[:1] - 1)).tolist(), len(frame)]
    return (range(first, last) for first, last in pairwise(edges))


def _nearest(pairs: list[int], objects: list[int], names: list[int], distance_m: Float64Array) -> list[int]:
    """As many pairs as possible, each object and track at most once, at the least sum of distances."""
    rows, columns = ({name: index for index, name in enumerate(dict.fromkeys(each))} for each in (objects, names))
    if len(rows) == len(columns) == len(pairs):
        return pairs
    cost, index = np.full((len(rows), len(columns)), _FORBIDDEN), np.zeros((len(rows), len(columns)), np.int64)
    at = [rows[name] for name in objects], [columns[name] for name in names]
    cost[at], index[at] = distance_m[pairs], pairs
    row, column = assigned(cost)
    chosen: list[int] = index[row, column][cost[row, column] < _FORBIDDEN].tolist()
    return chosen
