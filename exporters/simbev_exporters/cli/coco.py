"""``simbev export coco``: writes images of a dataset with boxes and masks in the layout of COCO."""

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


def export_coco(
    dataset: DatasetArgument,
    out: Out,
    rate_hz: RateHz = 2.0,
    classes: Classes = None,
    everything: Everything = False,
    pixels: Pixels = 1,
    cameras: Cameras = None,
    agent: ExportedAgentOption = None,
    workers: Workers = None,
    ray: Ray = None,
) -> None:
    """Write the images of finished scenes in the layout of COCO: boxes and masks of what is visible of objects.

    Images are in train, val and test as recorded, annotations in annotations/instances_train.json and so on. Cameras
    need the modalities rgb and instance.

    After Ctrl-C or a crash the same command continues where it stopped; of a dataset that has grown only new scenes are
    written.

    [bold]Examples[/]

    simbev export coco datasets/first --out coco

    simbev export coco datasets/first --out coco --rate-hz 1 --classes car,pedestrian --pixels 20
    """
    from simbev_exporters.coco.layout import Coco

    settings = chosen(rate_hz, classes, pixels, cameras, everything=everything)
    export_layout(dataset, out, Coco(**settings), agent, workers, ray)
