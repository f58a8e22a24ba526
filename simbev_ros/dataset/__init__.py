"""Datasets on disk: planning their scenes, indexing and checking finished ones, and reading them.

To read a dataset, call ``open_dataset``; it needs neither ROS nor a graphics card::

    from simbev_ros.dataset import columns, open_dataset
    from simbev_ros.foundation.geometry.transforms import apply, inverse

    scene = open_dataset("datasets/first").scenes[0]
    frame = scene[2]
    image = frame["cam_front/rgb"]                                      # (H, W, 3) uint8
    points = columns(frame["lidar/points"], "x", "y", "z")              # (N, 3) float32, frame of the lidar
    centers = columns(frame["boxes"], "x", "y", "z")                    # (M, 3) float64, map frame
    points_map = apply(frame.map_from_sensor("lidar"), points)
    centers_optical = apply(inverse(frame.map_from_optical("cam_front")), centers)
    ahead = centers_optical[centers_optical[:, 2] > 0]
    pixels = scene.calibration["cam_front"].camera.project(ahead)       # (A, 2), pixel centers at integers

``list(frame)`` names what a frame contains; ``simbev_ros.dataset.values`` documents the type of each value;
``simbev_ros.dataset.torch_dataset`` serves frames to a torch training loop.
"""

from typing import TYPE_CHECKING

from simbev_ros.foundation.lazy import lazy_names

if TYPE_CHECKING:
    from simbev_ros.dataset.frame import Frame
    from simbev_ros.dataset.opened import Dataset, Frames, open_dataset
    from simbev_ros.dataset.scene import Scene
    from simbev_ros.dataset.values import columns

__all__ = ["Dataset", "Frame", "Frames", "Scene", "columns", "open_dataset"]
__getattr__ = lazy_names(
    __name__,
    {
        "Dataset": "opened",
        "Frame": "frame",
        "Frames": "opened",
        "Scene": "scene",
        "columns": "values",
        "open_dataset": "opened",
    },
)
