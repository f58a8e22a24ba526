"""``simbev predict``: writes a baseline's predictions for a dataset."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from simbev_ros.cli.agent_option import AgentOption
from simbev_ros.cli.console import counting_bar, make_console
from simbev_ros.cli.pool import Workers, processes
from simbev_training.cli.cache_option import Cache, filled_cache


def predict(
    model: Annotated[
        str,
        typer.Argument(help="ONNX file of a baseline, or camera, lidar, fused.", metavar="MODEL", show_default=False),
    ],
    dataset: Annotated[Path, typer.Argument(help="The dataset.", show_default=False)],
    out: Annotated[Path, typer.Option(help="New folder for the predictions.", show_default=False)],
    split: Annotated[Literal["train", "val", "test"], typer.Option(help="Only scenes of this split.")] = "test",
    every: Annotated[int, typer.Option(help="Only every Nth key frame of each scene.", min=1)] = 1,
    track: Annotated[bool, typer.Option("--track", help="Track the boxes: they get ids.")] = False,
    agent: AgentOption = None,
    cache: Cache = None,
    workers: Workers = None,
) -> None:
    """Write a baseline's predictions for all key frames of a split, for simbev evaluate.

    Key frames are the frames with images of all cameras that suit the baselines, and a cloud.

    [bold]Examples[/]

    simbev predict lidar datasets/baselines --out predictions/lidar

    simbev predict runs/mine/model.onnx datasets/baselines --out predictions/mine --split val

    simbev predict lidar datasets/baselines --out predictions/tracks --track

    simbev evaluate predictions/lidar datasets/baselines --split test --every 10 --points 1
    """
    from simbev_ros.baselines.inference import Baseline
    from simbev_ros.baselines.model_file import model_file
    from simbev_training.cache.reader import cached_scenes
    from simbev_training.predict import predict as run

    baseline = Baseline(model_file(model))
    pool, console = processes(workers), make_console(stderr=True)
    scenes = cached_scenes(filled_cache(dataset, cache, baseline.modality, pool, console, agent), split)
    frames = sum(len(range(0, len(scene.frames), every)) for scene in scenes)
    with counting_bar("frames", console, frames) as bar:
        run(baseline, scenes, out, bar.advance, every, tracks=track)
    make_console().print(f"{frames} frames of {len(scenes)} scenes are predicted in {out}")
