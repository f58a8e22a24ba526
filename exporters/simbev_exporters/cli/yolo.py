"""``simbev export yolo``: writes images of a dataset with boxes or outlines in the layout of YOLO."""

from typing import Annotated

import typer

from simbev_exporters.cli.image_options import (
    Cameras,
    Classes,
    DatasetArgument,
    Everything,
    Out,
    Pixels,
    RateHz,
    chosen,
    export_layout,
)
from simbev_ros.cli.agent_option import ExportedAgentOption
from simbev_ros.cli.pool import Ray, Workers


def export_yolo(
    dataset: DatasetArgument,
    out: Out,
    segments: Annotated[
        bool, typer.Option("--segments", help="Labels are outlines of objects, for segmentation, instead of boxes.")
    ] = False,
    rate_hz: RateHz = 2.0,
    classes: Classes = None,
    everything: Everything = False,
    pixels: Pixels = 1,
    cameras: Cameras = None,
    agent: ExportedAgentOption = None,
    workers: Workers = None,
    ray: Ray = None,
) -> None:
    """Write the images of finished scenes in the layout of YOLO: boxes or outlines of what is visible of objects.

    data.yaml names the splits that there are, and the classes. Cameras need the modalities rgb and instance.

    After Ctrl-C or a crash the same command continues where it stopped; of a dataset that has grown only new scenes are
    written.

    [bold]Examples[/]

    simbev export yolo datasets/first --out yolo

    simbev export yolo datasets/first --out yolo-segments --segments --pixels 20
    """
    from simbev_exporters.yolo.layout import Yolo

    settings = chosen(rate_hz, classes, pixels, cameras, everything=everything)
    export_layout(dataset, out, Yolo(segments=segments, **settings), agent, workers, ray)
