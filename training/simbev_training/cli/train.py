"""``simbev train``: trains a baseline on a dataset."""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from simbev_ros.cli.agent_option import AgentOption
from simbev_ros.cli.console import counting_bar, make_console
from simbev_ros.cli.pool import Workers, processes
from simbev_ros.foundation.errors import InputError
from simbev_training.cli.cache_option import Cache, filled_cache


def train(
    config: Annotated[
        str,
        typer.Argument(help="Configuration file, or camera, lidar, fused.", metavar="CONFIG", show_default=False),
    ],
    datasets: Annotated[
        list[Path],
        typer.Argument(
            help="The dataset, or several; their split train is used.", metavar="DATASET...", show_default=False
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder of the run, new or begun.", show_default=False)],
    agent: AgentOption = None,
    cache: Cache = None,
    device: Annotated[
        str, typer.Option(help="auto, cpu, cuda, or another name that torch knows.", metavar="NAME")
    ] = "auto",
    workers: Workers = None,
) -> None:
    """Train a baseline for bird's-eye-view segmentation and 3D detection, and export it as ONNX.

    The same command continues after an interruption. The run's folder gets checkpoint.pt, model.onnx, and log, which
    TensorBoard reads. Before the first run, the dataset is unpacked into a cache, from which all runs read.

    [bold]Examples[/]

    simbev train lidar datasets/baselines --out runs/lidar

    simbev train lidar datasets/baselines datasets/road --out runs/lidar

    simbev train my.yaml datasets/baselines --out runs/mine --device cuda:1 --workers 8
    """
    from simbev_training.training.config import load_training

    training = load_training(config)
    try:
        import torch

        from simbev_training.training.export import export_run, models_to_average
        from simbev_training.training.loop import Progress, starting_files
        from simbev_training.training.loop import train as run
    except ImportError as error:
        raise InputError(
            f"training needs {error.name}; in the repository: {sys.executable} -m pip install './training[torch]'"
        ) from None
    chosen = _device(torch, device)
    starting_files(training, out)  # what is missing is said before the dataset is unpacked
    models_to_average(training)
    pool, console = processes(workers), make_console(stderr=True)
    if cache is not None and len(datasets) > 1:
        raise InputError("is for one dataset; those of several are next to them", parameter="cache")
    folders = [filled_cache(each, cache, training.modality, pool, console, agent) for each in datasets]
    with counting_bar("steps", console, elapsed=True) as bar:

        def report(progress: Progress) -> None:
            total = sum(value for name, value in progress.losses.items() if name != "samples_per_s")
            bar.describe(f"steps, loss {total:.3f}, {progress.losses['samples_per_s']:.0f} samples/s")
            bar.show(progress.step, progress.steps)

        run(training, folders, out, device=chosen, workers=pool.workers, report=report)
    path = export_run(training, out, folders[0])
    make_console().print(f"{path} is ready: simbev predict {path} {datasets[0]} --out predictions")


def _device(torch: Any, name: str) -> Any:
    cuda = torch.cuda.is_available()
    try:
        return torch.device(("cuda" if cuda else "cpu") if name == "auto" else name)
    except RuntimeError as error:
        raise InputError(f"is {name!r}: {str(error).splitlines()[0]}", parameter="device") from None
