"""Datasets: which scenes they are to have, which they have, and reading them.

To read one, ``open_dataset``; it needs neither ROS nor a graphics card::

    from simbev_ros.dataset import columns, open_dataset

    dataset = open_dataset("datasets/first")
    scene = dataset.scenes[0]
    frame = scene[17]
    image = frame["cam_front/rgb"]                              # (H, W, 3) uint8
    points = columns(frame["lidar/points"], "x", "y", "z")      # (N, 3) float32, in the lidar's frame
    boxes = frame["boxes"]                                      # (M,) rows, in the map frame
    camera = scene.calibration["cam_front"].camera
    optical_from_map = inverse(frame.map_from_optical("cam_front"))
    pixels = camera.project(apply(optical_from_map, columns(boxes, "x", "y", "z")))
"""

from simbev_ros.dataset.opened import Dataset, Frames, open_dataset
from simbev_ros.dataset.scene import Frame, Scene, columns

__all__ = ["Dataset", "Frame", "Frames", "Scene", "columns", "open_dataset"]
