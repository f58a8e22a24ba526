"""``simbev predict``: writes a baseline's predictions for a dataset, or for a recording of real sensors."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from simbev_ros.cli.agent_option import AgentOption
from simbev_ros.cli.console import counting_bar, make_console
from simbev_ros.cli.pool import Workers, processes
from simbev_ros.foundation.errors import InputError
from simbev_training.cli.cache_option import Cache, filled_cache
from simbev_training.cli.recording_output import predict_real_frames

if TYPE_CHECKING:
    from simbev_ros.baselines.inference import Baseline

_OF_DATASETS = ("split", "track", "agent", "cache", "workers")


def predict(
    model: Annotated[
        str,
        typer.Argument(help="ONNX file of a baseline, or camera, lidar, fused.", metavar="MODEL", show_default=False),
    ],
    dataset: Annotated[Path, typer.Argument(help="The dataset, or the folder of a recording.", show_default=False)],
    out: Annotated[Path, typer.Option(help="New folder for the predictions.", show_default=False)],
    split: Annotated[
        Literal["train", "val", "test"] | None, typer.Option(help="Only scenes of this split; without it, test.")
    ] = None,
    every: Annotated[int, typer.Option(help="Only every Nth key frame of each scene, or frame.", min=1)] = 1,
    track: Annotated[
        bool, typer.Option("--track", help="Track the boxes of a dataset or of nuScenes: they get ids.")
    ] = False,
    layout: Annotated[
        Literal["simbev", "kitti", "nuscenes", "folder"],
        typer.Option(
            "--format",
            help="Layout: a dataset of this package; KITTI's object detection; nuScenes; or a folder of clouds "
            "(.bin, .npy, .pcd, .ply), which sensors.yaml in it describes.",
        ),
    ] = "simbev",
    version: Annotated[str, typer.Option(help="For nuScenes: folder of the tables.", metavar="NAME")] = "v1.0-mini",
    pictures: Annotated[bool, typer.Option(help="For real sensors: draw each frame.")] = True,
    grids: Annotated[bool, typer.Option("--grids", help="For real sensors: also write the grid's scores.")] = False,
    min_score: Annotated[float, typer.Option(help="Score from which boxes are drawn.", min=0, max=1)] = 0.3,
    points: Annotated[int, typer.Option(help="For real sensors: only labels with N points count.", min=0)] = 5,
    agent: AgentOption = None,
    cache: Cache = None,
    workers: Workers = None,
) -> None:
    """Write a baseline's predictions for all key frames of a split, or for a recording of real sensors.

    Key frames are the frames with images of all cameras that suit the baselines, and a cloud. simbev evaluate reads
    their predictions.

    For real sensors, boxes.csv has the boxes in the lidar's frame, and pictures show them. KITTI and nuScenes also get
    results for their own evaluation, nuScenes with --track also for that of tracks. Where there are labels, the average
    precision is printed.

    [bold]Examples[/]

    simbev predict lidar datasets/baselines --out predictions/lidar

    simbev predict runs/mine/model.onnx datasets/baselines --out predictions/mine --split val

    simbev predict lidar datasets/baselines --out predictions/tracks --track

    simbev evaluate predictions/lidar datasets/baselines --split test --every 10 --points 1

    simbev predict lidar ~/kitti/training --format kitti --out predictions/kitti --every 100

    simbev predict fused ~/nuscenes --format nuscenes --version v1.0-mini --out predictions/nuscenes

    simbev predict lidar ~/my_recording --format folder --out predictions/mine
    """
    from simbev_ros.baselines.inference import Baseline
    from simbev_ros.baselines.model_file import model_file

    baseline = Baseline(model_file(model))
    if layout == "simbev":
        _predict_dataset(baseline, dataset, out, split or "test", every, track, agent, cache, workers)
        return
    given = dict(
        zip(_OF_DATASETS, (split, (track and layout != "nuscenes") or None, agent, cache, workers), strict=True)
    )
    wrong = next((name for name, value in given.items() if value is not None), None)
    if wrong is not None:
        raise InputError(f"is {given[wrong]!s:.80}; recordings with --format {layout} have none", parameter=wrong)
    from simbev_training.recordings.prediction import Wanted

    wanted = Wanted(pictures, grids, min_score, points, track)
    predict_real_frames(baseline, dataset, out, layout, version, every, wanted)


def _predict_dataset(
    baseline: "Baseline",
    dataset: Path,
    out: Path,
    split: str,
    every: int,
    track: bool,
    agent: str | None,
    cache: Path | None,
    workers: str | None,
) -> None:
    """Write the predictions for a dataset of this package."""
    from simbev_training.cache.reader import cached_scenes
    from simbev_training.predict import predict as run

    pool, console = processes(workers), make_console(stderr=True)
    scenes = cached_scenes(filled_cache(dataset, cache, baseline.modality, pool, console, agent), split)
    frames = sum(len(range(0, len(scene.frames), every)) for scene in scenes)
    with counting_bar("frames", console, frames) as bar:
        run(baseline, scenes, out, bar.advance, every, tracks=track)
    make_console().print(f"{frames} frames of {len(scenes)} scenes are predicted in {out}")
