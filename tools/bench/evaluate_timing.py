"""Times the detection metrics on as many scenes as the paper has, with the nuscenes-devkit for comparison."""

import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from simbev_ros.dataset.parallel import map_in_processes
from simbev_ros.evaluation.metrics.boxes import Boxes, Predictions
from simbev_ros.evaluation.metrics.detection import DetectionOptions, DetectionTally, detection_result, merge_tallies
from simbev_ros.evaluation.metrics.nuscenes import NuscenesResult, nuscenes_merge, nuscenes_result, nuscenes_tally
from simbev_ros.evaluation.metrics.scene_matching import Matching
from tools.bench.devkit_comparison import DEVKIT, devkit_numbers, devkit_python
from tools.bench.evaluation_load import FRAMES, synthetic_scene
from tools.bench.stopwatch import Cost, Stopwatch

_TIMED = 5
"""Number of scenes whose parts are timed; the first one is for warm-up."""
_DEVKIT_FRAMES = 40
_WAYS: dict[str, DetectionOptions] = {
    "by IoU": DetectionOptions(distances_m=()),
    "by distance": DetectionOptions(ious=()),
    "by both": DetectionOptions(),
}
_NUSCENES = "by nuScenes' metrics"


@dataclass(frozen=True, slots=True)
class DevkitTiming:
    """The same boxes evaluated by the devkit and by our variant of its metrics.

    Attributes:
        frames: Number of frames.
        devkit_s: Time of the devkit, without the conversion of boxes into its objects.
        own_s: Time of ours, the median.
        nds_difference: Difference of the nuScenes detection scores.
    """

    frames: int
    devkit_s: float
    own_s: float
    nds_difference: float


@dataclass(frozen=True, slots=True)
class EvaluateTiming:
    """Time and memory of an evaluation.

    Attributes:
        scenes: Number of scenes, of 320 frames each.
        truths: Number of ground-truth boxes in them.
        predictions: Number of predicted boxes in them.
        costs: Times of the parts of an evaluation, per scene.
        workers: Number of processes that shared the scenes.
        scenes_s: Wall time of all scenes, including their generation.
        result_s: Wall time of merging them and of computing the result.
        memory_mib: Maximum memory of all processes together; shared memory is counted for each of them.
        devkit: The comparison; None: there is no devkit.
    """

    scenes: int
    truths: int
    predictions: int
    costs: list[Cost]
    workers: int
    scenes_s: float
    result_s: float
    memory_mib: float
    devkit: DevkitTiming | None

    def title(self) -> str:
        """Title of the table."""
        boxes = f"{self.truths / 1e6:.1f} M boxes and {self.predictions / 1e6:.1f} M predictions"
        return f"evaluating {self.scenes} scenes, {self.scenes * FRAMES:,} frames, {boxes}"

    def rows(self) -> list[tuple[str, ...]]:
        """Rows of the table: each part with its wall and processor time, then the whole."""
        rows = [(f"a scene {each.name}", each.wall_ms / 1e3, each.cpu_ms / 1e3) for each in self.costs]
        return [
            *((name, f"{wall_s:.3f}", f"{cpu_s:.3f}") for name, wall_s, cpu_s in rows),
            (f"all scenes, {self.workers} processes", f"{self.scenes_s:.1f}", ""),
            ("merged, and the table", f"{self.result_s:.1f}", ""),
        ]

    def comparison(self) -> str:
        """A sentence on memory and one on the devkit."""
        memory = f"At most {self.memory_mib / 1024:.1f} GiB."
        if self.devkit is None:
            return f"{memory} There is no {DEVKIT} to compare with."
        known, ratio = self.devkit, self.devkit.devkit_s / self.devkit.own_s
        return (
            f"{memory} {DEVKIT} takes {known.devkit_s:.1f} s for {known.frames} frames, its metrics here "
            f"{known.own_s * 1e3:.0f} ms: {ratio:.0f} times as fast, and NDS differs by {known.nds_difference:.0e}."
        )


def timed_evaluation(scenes: int, workers: int, advance: Callable[[], None] = lambda: None) -> EvaluateTiming:
    """Evaluate synthetic scenes.

    Args:
        scenes: Number of scenes.
        workers: Number of processes that share them.
        advance: Called after each scene.

    Raises:
        SimbevError: A process was killed, or the devkit fails.
    """
    costs = _costs()
    began_s, tallies = time.perf_counter(), []
    for each in map_in_processes(_tally_of, range(scenes), workers):
        tallies.append(each)
        advance()
    scenes_s = time.perf_counter() - began_s
    total = merge_tallies(tallies)
    detection_result(total)
    result_s = time.perf_counter() - began_s - scenes_s
    truths, predictions = int(total.truths.sum()), len(total.score)
    return EvaluateTiming(
        scenes, truths, predictions, costs, workers, scenes_s, result_s, _memory_mib(workers), _compared()
    )


def _tally_of(seed: int) -> DetectionTally:
    return _tally(*synthetic_scene(seed))


def _tally(truth: Boxes, predictions: Predictions, options: DetectionOptions | None = None) -> DetectionTally:
    return Matching(truth, predictions, np.arange(FRAMES), options).tally()


def _costs() -> list[Cost]:
    watch, frames = Stopwatch(), np.arange(FRAMES)
    for seed in range(_TIMED):
        boxes = synthetic_scene(seed)
        for name, options in _WAYS.items():
            watch.run(name, partial(_tally, *boxes, options))
        watch.run(_NUSCENES, partial(nuscenes_tally, *boxes, frames))
    return [watch.cost(name) for name in (*_WAYS, _NUSCENES)]


def _memory_mib(workers: int) -> float:
    """Maximum memory of this process and its children so far."""
    own, others = (resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return (own + (workers * others if workers > 1 else 0)) / 1024


def _compared() -> DevkitTiming | None:
    python = devkit_python()
    if python is None:
        return None
    truth, predictions = synthetic_scene(0, _DEVKIT_FRAMES)
    watch = Stopwatch()
    for _ in range(_TIMED):
        own = watch.run("own", partial(_by_nuscenes, truth, predictions))
    numbers = devkit_numbers(python, truth, predictions, range(_DEVKIT_FRAMES))
    own_s = watch.cost("own").wall_ms / 1e3
    return DevkitTiming(_DEVKIT_FRAMES, numbers["seconds"], own_s, abs(own.nds - numbers["nd_score"]))


def _by_nuscenes(truth: Boxes, predictions: Predictions) -> NuscenesResult:
    return nuscenes_result(nuscenes_merge([nuscenes_tally(truth, predictions, np.arange(_DEVKIT_FRAMES))]))
