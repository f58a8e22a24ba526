"""``simbev evaluate``: measures predictions with the metrics of the paper."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import typer

from simbev_ros.cli.agent_option import AgentOption
from simbev_ros.cli.console import counting_bar, make_console
from simbev_ros.cli.output_file import require_place
from simbev_ros.cli.pool import Workers, processes
from simbev_ros.foundation.files.whole_files import write_errors
from simbev_ros.foundation.installation.extras import load_extras

_WORDS = "with commas between"
_COUNTED = "What counts"
_OUTPUT = "Output"


def evaluate(
    predictions: Annotated[
        Path, typer.Argument(help="A Parquet, NPZ or MCAP file, a bag, or a folder of them.", show_default=False)
    ],
    dataset: Annotated[Path, typer.Argument(help="The dataset, or one scene's bag.", show_default=False)],
    split: Annotated[Literal["train", "val", "test"] | None, typer.Option(help="Only scenes of this split.")] = None,
    scenes: Annotated[str | None, typer.Option(help=f"Only these scenes, {_WORDS}.", metavar="NAMES")] = None,
    agent: AgentOption = None,
    truth: Annotated[
        Literal["own", "joint"],
        typer.Option(
            help="Boxes to find: the agent's own, or with the points and the visibility of all agents together."
        ),
    ] = "own",
    every: Annotated[int, typer.Option(help="Evaluate every Nth frame of each scene.", min=1)] = 1,
    classes: Annotated[
        str | None, typer.Option(help=f"Only these classes of boxes and cells, {_WORDS}.", metavar="NAMES")
    ] = None,
    distance: Annotated[
        str,
        typer.Option(
            "--range",
            help="Distance range from the ego vehicle, in meters.",
            metavar="FROM:TO",
            rich_help_panel=_COUNTED,
        ),
    ] = "0:",
    visibility: Annotated[
        float, typer.Option(help="Minimum visible share of a box.", min=0, max=1, rich_help_panel=_COUNTED)
    ] = 0.0,
    points: Annotated[
        int, typer.Option(help="Minimum number of lidar and radar points in a box.", min=0, rich_help_panel=_COUNTED)
    ] = 0,
    difficulty: Annotated[
        str | None, typer.Option(help=f"Difficulties of boxes, {_WORDS}.", metavar="NAMES", rich_help_panel=_COUNTED)
    ] = None,
    daytime: Annotated[
        str | None, typer.Option(help="Times of day: day, twilight, night.", metavar="NAMES", rich_help_panel=_COUNTED)
    ] = None,
    weather: Annotated[
        str | None, typer.Option(help="Weather: clear, cloudy, fog, rain.", metavar="NAMES", rich_help_panel=_COUNTED)
    ] = None,
    by: Annotated[
        str,
        typer.Option(
            help=f"Tables by distance, visibility, points, difficulty, daytime, weather, map, {_WORDS}.",
            metavar="NAMES",
        ),
    ] = "distance",
    rings: Annotated[
        str, typer.Option(help="Start of each ring of distance, in meters.", metavar="METERS")
    ] = "0,20,40,60",
    ious: Annotated[
        str, typer.Option(help="Thresholds for matching by 3D IoU.", metavar="NUMBERS")
    ] = "0.3,0.4,0.5,0.6,0.7,0.8,0.9",
    distances: Annotated[
        str, typer.Option(help="Thresholds for matching by distance, in meters.", metavar="NUMBERS")
    ] = "0.5,1,2,4",
    planar: Annotated[bool, typer.Option("--planar", help="Distances and velocities without z.")] = False,
    envelope: Annotated[
        bool, typer.Option("--envelope", help="Area under the envelope of precision over recall, as Pascal VOC.")
    ] = False,
    nuscenes: Annotated[
        bool, typer.Option("--nuscenes", help="Also compute the metrics of nuScenes, over its keyframes and classes.")
    ] = False,
    boxes_topic: Annotated[
        str | None,
        typer.Option(help="Topic of boxes in bags; by default /prediction/boxes, with --agent /NAME/prediction/boxes."),
    ] = None,
    grids_topic: Annotated[
        str | None,
        typer.Option(help="Topic of cell scores in bags; by default /prediction/bev, with --agent likewise."),
    ] = None,
    report: Annotated[
        Path | None, typer.Option(help="HTML file with curves, tables and the worst frames.", rich_help_panel=_OUTPUT)
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="File for all figures.", rich_help_panel=_OUTPUT)
    ] = None,
    workers: Workers = None,
) -> None:
    """Measure predictions: AP by 3D IoU and distance, mAP, ATE, AOE, ASE, AVE, SDS, and bird's-eye-view IoU.

    Every frame of the chosen scenes counts; one without a prediction is missed. Classes without ground truth are not
    part of any mean; nuScenes' own means count them as 0, so --nuscenes also gives means without them.
    Conditions: rain from a precipitation of 10 % on, else fog from a density of 20 %, else cloudy from 60 %; twilight
    while the sun is within 6° of the horizon. Each row of a table covers a part of the data: a false positive counts
    in every row that its distance and frame belong to, and in none beyond the range within which boxes are labeled.

    [bold]Examples[/]

    simbev evaluate predictions.parquet datasets/first --split val

    simbev evaluate results datasets/first --range :50 --points 1 --classes car,pedestrian --by distance,weather

    simbev evaluate stack.mcap datasets/first/scenes/val/Town03-0004 --report report.html --json figures.json

    simbev evaluate fused.parquet datasets/cars --agent car_2 --truth joint --points 1
    """
    from simbev_ros.cli.evaluate import options as parse
    from simbev_ros.cli.evaluate.tables import print_tables
    from simbev_ros.dataset import open_dataset
    from simbev_ros.evaluation.evaluation import evaluate as evaluate_dataset
    from simbev_ros.evaluation.figures import figures_of
    from simbev_ros.evaluation.metrics.detection import DetectionOptions
    from simbev_ros.evaluation.options import EvaluationOptions
    from simbev_ros.evaluation.predictions.dataset_predictions import open_predictions
    from simbev_ros.evaluation.slices import table_slices

    counted = parse.counted(
        distance=distance,
        visibility=visibility,
        points=points,
        difficulty=difficulty,
        daytime=daytime,
        weather=weather,
    )
    groups, starts_m = parse.comma_separated("--by", by) if by else (), parse.numbers("--rings", rings)
    box_classes, bev_classes = parse.classes("--classes", classes)
    options = EvaluationOptions(
        slices=tuple(table_slices(counted, groups, starts_m)),
        detection=DetectionOptions(
            ious=parse.thresholds("--ious", ious, 1.0),
            distances_m=parse.thresholds("--distances", distances, 1000.0),
            planar=planar,
            area="envelope" if envelope else "steps",
        ),
        box_classes=box_classes,
        bev_classes=bev_classes,
        every=every,
        nuscenes=nuscenes,
        truth=truth,
    )
    pool = processes(workers)
    if report is not None:
        load_extras()["pictures"].require("simbev evaluate --report")
    for file in filter(None, (report, json_file)):
        require_place(file)
    opened, console = open_dataset(dataset, threads=1), make_console(highlight=False)
    chosen = parse.chosen_scenes(opened, split, scenes, agent)
    if "map" in groups:
        counted = replace(counted, maps=tuple(sorted({scene.map for scene in chosen})))
        options = replace(options, slices=tuple(table_slices(counted, groups, starts_m)))
    usual = parse.answer_topics(chosen, agent)
    predicted = open_predictions(predictions, boxes_topic or usual[0], grids_topic or usual[1])
    predicted = predicted.for_dataset([s.name for s in opened.scenes])
    frames = sum(len(range(0, len(scene), every)) for scene in chosen)
    with counting_bar("frames", make_console(stderr=True), frames) as bar:
        result = evaluate_dataset(chosen, predicted, options, pool, bar.show)
    whose = {"agent": agent, "truth": truth} if agent is not None or truth != "own" else {}
    figures = {"dataset": str(dataset), "predictions": str(predictions), **whose, **figures_of(result)}
    if json_file is not None:  # before the tables, whose reader may close the pipe, as head does
        with write_errors(json_file):
            json_file.write_text(json.dumps(figures, indent=2) + "\n")
        console.print(f"figures in {json_file}", soft_wrap=True)
    print_tables(figures, console)
    if report is not None:
        from simbev_ros.show.reports.evaluation_report import write_evaluation_report

        with make_console(stderr=True).status("report"), write_errors(report):
            write_evaluation_report(report, result, chosen, predicted, figures)
        console.print(f"report in {report}", soft_wrap=True)
