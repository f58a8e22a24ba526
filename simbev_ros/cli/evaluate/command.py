"""``simbev evaluate``: measures predictions with the metrics of the paper."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simbev_ros.cli.agent_option import AgentOption
from simbev_ros.cli.console import counting_bar, make_console
from simbev_ros.cli.evaluate import options as option
from simbev_ros.cli.evaluate.drives import drives_beside, evaluate_drives
from simbev_ros.cli.output_file import require_place
from simbev_ros.cli.pool import Workers, processes
from simbev_ros.foundation.errors import InputError, SimbevError
from simbev_ros.foundation.files.whole_files import write_errors
from simbev_ros.foundation.installation.extras import load_extras
from simbev_ros.recording.layout import is_dataset

if TYPE_CHECKING:
    from simbev_ros.config.evaluation import Evaluation
    from simbev_ros.evaluation.tables import FigureTable


def evaluate(
    predictions: option.Predictions,
    dataset: option.DatasetArgument = None,
    config: option.Config = None,
    split: option.Split = None,
    scenes: option.Scenes = None,
    agent: AgentOption = None,
    truth: option.TruthOption = None,
    distance: option.Range = None,
    points: option.MinPoints = None,
    classes: option.Classes = None,
    everything: option.Everything = False,
    by: option.By = None,
    every: option.Every = 1,
    nuscenes: option.NuScenes = False,
    report: option.Report = None,
    json_file: option.JsonFile = None,
    workers: Workers = None,
) -> None:
    """Measure predictions: AP by 3D IoU and distance, mAP, ATE, AOE, ASE, AVE, SDS, and bird's-eye-view IoU.

    The paper's classes count, and boxes that a lidar, radar or camera sees; a line says how many are left out.

    Every frame of the chosen scenes counts; one without a prediction is missed. Classes without ground truth are not
    part of any mean; nuScenes' own means count them as 0, so --nuscenes also gives means without them. Each row of a
    table covers a part of the data: a false positive counts in every row that its distance and frame belong to, and in
    none beyond the range within which boxes are labeled.

    With a dataset alone, the drives of its scenes are scored as by CARLA's leaderboards 2.0 and 2.1, Bench2Drive and
    nuPlan; --split, --scenes, --report and --json apply. With predictions, their scores come last.

    If boxes have ids of tracks, there are also tracking metrics: AMOTA, AMOTP, MOTA, MOTP, IDS, FRAG, and HOTA, also in
    the tables by daytime, weather and map.

    [bold]Examples[/]

    simbev evaluate predictions.parquet datasets/first --split val --report report.html --json figures.json

    simbev evaluate results datasets/first --range :50 --points 1 --classes car,pedestrian --by distance,weather

    simbev evaluate predictions/tracks datasets/baselines --split test --every 10 --points 1 --range :50

    simbev evaluate fused.parquet datasets/cars --agent car_2 --truth joint --points 1

    simbev evaluate datasets/drives --report drives.html --json drives.json

    simbev evaluate stack.mcap datasets/first/scenes/val/Town03-0004 --config night.yaml
    """
    _require_places(report, json_file)
    if dataset is None:
        evaluate_drives(predictions, split, scenes, report, json_file)
        return
    section = option.chosen_section(config, truth, distance, points, classes, by, everything=everything)
    _evaluate_predictions(
        predictions, dataset, section, split, scenes, agent, every, nuscenes, report, json_file, workers
    )


def _evaluate_predictions(
    predictions: Path,
    dataset: Path,
    section: "Evaluation",
    split: option.Split,
    scenes: option.Scenes,
    agent: AgentOption,
    every: int,
    nuscenes: bool,
    report: Path | None,
    json_file: Path | None,
    workers: Workers,
) -> None:
    """Measure predictions for a dataset, and show the figures; the arguments are those of ``evaluate``."""
    from simbev_ros.dataset import open_dataset
    from simbev_ros.evaluation.evaluation import evaluate as evaluate_dataset
    from simbev_ros.evaluation.figures import figures_of
    from simbev_ros.evaluation.options import options_of
    from simbev_ros.evaluation.predictions.dataset_predictions import open_predictions

    pool = processes(workers)
    with _noticing_swapped(predictions, dataset):
        opened = open_dataset(dataset, threads=1)
        chosen = option.chosen_scenes(opened, split, scenes, agent)
    options = options_of(section, maps=sorted({each.map for each in chosen}), every=every, nuscenes=nuscenes)
    predicted = open_predictions(predictions, *option.answer_topics(section, chosen, agent))
    predicted = predicted.for_dataset([each.name for each in opened.scenes])
    frames = sum(len(range(0, len(scene), every)) for scene in chosen)
    with counting_bar("frames", make_console(stderr=True), frames) as bar:
        result = evaluate_dataset(chosen, predicted, options, pool, bar.show)
    seen_by = {"agent": agent, "truth": section.truth} if agent is not None or section.truth != "own" else {}
    figures = {"dataset": str(dataset), "predictions": str(predictions), **seen_by, **figures_of(result)}
    drives, tables = drives_beside(chosen, make_console(stderr=True))
    figures |= drives
    _show_figures(figures, json_file, tables)
    if report is not None:
        _write_report(report, result, chosen, predicted, figures, tables)


@contextmanager
def _noticing_swapped(predictions: Path, dataset: Path) -> Iterator[None]:
    """Context for opening the dataset: says of an error that the arguments are swapped if they seem to be."""
    try:
        yield
    except InputError:
        is_recorded = is_dataset(dataset) or dataset.suffix == ".mcap" or any(dataset.glob("*.mcap"))
        if is_recorded or not _opens(predictions):
            raise
        raise InputError(f"{dataset}: is not a dataset, but {predictions} is; they seem to be swapped") from None


def _opens(path: Path) -> bool:
    """Whether a path is a dataset that can be read."""
    from simbev_ros.dataset import open_dataset

    try:
        return any(scene.spec for scene in open_dataset(path, threads=1).scenes[:1])
    except SimbevError:
        return False


def _write_report(report: Path, *content: Any) -> None:
    """Write the page; ``content`` as for ``write_evaluation_report``."""
    from simbev_ros.show.reports.evaluation_report import write_evaluation_report

    with make_console(stderr=True).status("report"), write_errors(report):
        write_evaluation_report(report, *content)
    make_console(highlight=False).print(f"report in {report}", soft_wrap=True)


def _require_places(report: Path | None, json_file: Path | None) -> None:
    """Refuse files that cannot be written, before the work begins."""
    if report is not None:
        load_extras()["pictures"].require("simbev evaluate --report")
    for file in filter(None, (report, json_file)):
        require_place(file)


def _show_figures(figures: Mapping[str, Any], json_file: Path | None, drives: "Sequence[FigureTable]") -> None:
    """Write the figures to a file, if there is to be one, and print them as tables, those of drives last."""
    from simbev_ros.cli.evaluate.tables import print_figure_tables, print_tables, write_figures

    console = make_console(highlight=False)
    if json_file is not None:  # before the tables, because their reader may close the pipe, as head does
        write_figures(json_file, figures, console)
    print_tables(figures, console)
    print_figure_tables(drives, console)
