"""The output of ``simbev generate --dry-run``: scenes to make, and what they would cost."""

from collections.abc import Callable, Sequence

from rich.console import Console
from rich.table import Table

from simbev_ros.cli.console import format_duration, format_size
from simbev_ros.cli.production_display import SceneDisplay
from simbev_ros.config.scenario import SPLITS, Scenario
from simbev_ros.foundation.object_store.object_path import AnyPath
from simbev_ros.production.dataset import plan_scenes
from simbev_ros.production.dataset_storage import require_writable_dataset
from simbev_ros.production.estimate import SAMPLE_TICKS, Estimate, SceneCounts, count_scenes, estimate_dataset
from simbev_ros.production.scene_cost import SceneCost


def show_estimate(
    scenario: Scenario,
    dataset: AnyPath,
    replace: Sequence[range],
    console: Console,
    speedup: Callable[[SceneCost], float],
) -> None:
    """Print which scenes would be made and their estimated cost; nothing is written into the dataset.

    Args:
        scenario: The configuration.
        dataset: The dataset's folder, which need not exist.
        replace: Numbers of scenes to make again.
        console: Where to print.
        speedup: See ``estimate_dataset``.

    Raises:
        InputError: The dataset cannot be written to, the plan of the dataset or the configuration is wrong, or the
            sample cannot be played.
        GraphError: A node died or fell silent.
    """
    _, entries = plan_scenes(scenario, dataset, replace)
    require_writable_dataset(dataset)
    console.print(_counts_table(*count_scenes(dataset, entries)))
    if not entries:
        console.print("nothing is missing")
        return
    estimate = estimate_dataset(scenario, dataset, entries, SceneDisplay(console), speedup)
    console.print(_sentence(estimate, entries[0].name), highlight=False, soft_wrap=True)


def _counts_table(existing: SceneCounts, missing: SceneCounts) -> Table:
    table = Table("map", *(f"{split}: {state}" for split in SPLITS for state in ("there", "to make")))
    for name in dict.fromkeys(name for name, _ in (*existing, *missing)):
        table.add_row(name, *(str(counts[name, split]) for split in SPLITS for counts in (existing, missing)))
    return table


def _sentence(estimate: Estimate, sampled: str) -> str:
    sample = estimate.sample
    free = "" if estimate.free_bytes is None else f" ({format_size(estimate.free_bytes)} are free)"
    return (
        f"{estimate.scenes} scenes, {estimate.frames:,} frames: about {format_duration(estimate.duration_s)} and "
        f"{format_size(estimate.size_bytes)}{free}; measured on {SAMPLE_TICKS} "
        f"frames of {sampled}: {sample.start_s:.1f} s to begin, {sample.tick_s:.2f} s and "
        f"{format_size(sample.tick_bytes)} a frame, on one graph here"
        + (f"; graphs side by side {estimate.speedup:.1f} times as fast" if estimate.speedup > 1.0 else "")
    )
