"""Draws one frame of a scene as all of its agents see it: a plan with their points and boxes, and a picture of each.

A ``Frame`` of the dataset reader enters; an RGB picture leaves.
"""

from collections.abc import Iterator, Mapping

import cv2
import numpy as np

from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.dataset.frame import Frame
from simbev_ros.dataset.scene import Scene
from simbev_ros.drawing.box_lines import box_outlines
from simbev_ros.drawing.canvas import (
    BACKGROUND,
    BOLD,
    DIM,
    SURFACE,
    TEXT,
    Box,
    Color,
    draw_label,
    draw_picture,
    draw_text,
)
from simbev_ros.foundation.geometry.transforms import apply
from simbev_ros.foundation.types import AnyArray, Float64Array, Table, UInt8Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.build import load_network
from simbev_ros.show.maps.map_plan import MapPlan
from simbev_ros.show.sheet.layout import Block, Column, Row, Tile, place_in_width
from simbev_ros.show.sheet.views import main_camera_rank
from simbev_ros.simulation.annotation.boxes.joint import TOGETHER_DTYPE

DESIGN_WIDTH_PX = 1920
"""Sheet width in pixels for which the lengths below are given; they scale with the actual width."""

_MARGIN, _GAP, _HEADER, _FOOTER, _RADIUS = 24, 10, 66, 34, 7
_PLAN = ""
"""Key of the plan in the layout; pictures have the names of their agents."""
_AROUND_M, _MIN_SIDE_M = 45.0, 120.0
_LAND_STRENGTH = 0.3
_ROWS = 3
"""Maximum number of agents' pictures above one another."""
_OVERSAMPLING = 2
_FRACTION_BITS = 4
_COLORS: tuple[Color, ...] = (
    *((45, 212, 191), (255, 178, 56), (178, 132, 255), (255, 110, 122)),
    *((92, 172, 255), (168, 222, 90), (255, 140, 215), (214, 178, 140)),
    *((245, 230, 90), (100, 120, 240), (60, 170, 90), (205, 90, 55)),
)
"""Colors of the agents, in their order; with more of them they recur."""


class AgentsSheet:
    """A sheet for one scene with several agents, drawn again for each frame.

    Attributes:
        size_px: Width and height of the sheet, both even.
    """

    def __init__(self, scene: Scene, width_px: int = DESIGN_WIDTH_PX) -> None:
        """Prepare the layout.

        Args:
            scene: The scene, as any of its agents sees it.
            width_px: Width of the sheet, even; its height follows.

        Raises:
            InputError: The map of the scene cannot be read.
        """
        self._scenes = {name: scene.of_agent(name) for name in scene.agents}
        self._colors = {name: _COLORS[index % len(_COLORS)] for index, name in enumerate(self._scenes)}
        self._scale = width_px / DESIGN_WIDTH_PX
        self._network = load_network(scene.spec.map)
        self._cameras = {name: camera for name, each in self._scenes.items() if (camera := _main_camera(each))}
        margin, gap = round(_MARGIN * self._scale), round(_GAP * self._scale)
        top = round(_HEADER * self._scale)
        self._boxes = place_in_width(_arranged(self._cameras), margin, top, width_px - 2 * margin, gap)
        bottom = max(box.top + box.height for box in self._boxes.values()) + round(_FOOTER * self._scale)
        self.size_px = (width_px, bottom + bottom % 2)

    def draw(self, tick: int) -> UInt8Array:
        """Draw the frame of a tick as (H, W, 3) uint8 RGB."""
        frames = {name: scene[tick] for name, scene in self._scenes.items()}
        sheet = np.full((*reversed(self.size_px), 3), BACKGROUND, np.uint8)
        self._draw_words(sheet, next(iter(frames.values())))
        plan = self._boxes[_PLAN]
        draw_picture(sheet, self._plan(frames, plan.width), plan, _RADIUS * self._scale)
        for name, camera in self._cameras.items():
            self._draw_camera(sheet, frames[name], camera, self._boxes[name])
        return sheet

    def _draw_words(self, sheet: UInt8Array, frame: Frame) -> None:
        """Write scene, time and legend above and below the pictures."""
        scale, (width, height) = self._scale, self.size_px
        left, right = _MARGIN * scale, width - _MARGIN * scale
        end = draw_text(sheet, frame.scene.name, left, 44 * scale, size=30 * scale, weight=BOLD)
        facts = f"{len(self._scenes)} agents: lidar points in the color of the agent that receives them"
        draw_text(sheet, facts, end + 20 * scale, 44 * scale, size=18 * scale, color=DIM)
        time = f"{(frame.stamp_ns - frame.scene.spec.start_ns) / NS_PER_S:.2f} s"
        draw_text(sheet, time, right, 44 * scale, size=24 * scale, weight=BOLD, right=True)
        x, baseline = left, height - 12 * scale
        for text, color in (("Boxes seen by several agents", TEXT), ("by none", DIM)):
            x = draw_text(sheet, text, x, baseline, size=16 * scale, color=color) + 16 * scale
        for name, color in self._colors.items():
            x = draw_text(sheet, f"by {name} alone", x, baseline, size=16 * scale, color=color) + 16 * scale

    def _draw_camera(self, sheet: UInt8Array, frame: Frame, camera: Camera, box: Box) -> None:
        """Draw the latest picture of an agent's camera above a bar in the agent's color."""
        try:
            picture: UInt8Array = frame.last(f"{camera.name}/rgb")
        except KeyError:
            picture = np.full((box.height, box.width, 3), SURFACE, np.uint8)
        draw_picture(sheet, picture, box, _RADIUS * self._scale)
        agent, note = frame.scene.agent, camera.name.removeprefix("cam_").replace("_", " ")
        draw_label(sheet, box, agent, note, self._scale)
        bottom, bar_px = box.top + box.height, round(5 * self._scale)
        sheet[bottom - bar_px : bottom, box.left : box.left + box.width] = self._colors[agent]

    def _plan(self, frames: Mapping[str, Frame], size_px: int) -> UInt8Array:
        """Square plan of the surroundings of all agents, north up."""
        poses = {name: frame.map_from_ego for name, frame in frames.items()}
        plan = _Plan(np.array([pose[:2, 3] for pose in poses.values()]), size_px)
        plan.add_land(MapPlan(self._network, plan.center_m, plan.side_m, size_px).picture())
        for name, frame in frames.items():
            plan.add_points(_points_m(frame), self._colors[name])
        first = next(iter(frames.values()))
        if "world/boxes" in first:
            boxes = first["world/boxes"]
            plan.add_boxes(boxes, self._colors_of(boxes))
        for name, pose in poses.items():
            plan.add_agent(pose[:2, 3], self._colors[name], self._scale)
        picture = plan.picture()
        for name, pose in poses.items():
            left, top = plan.pixels(pose[:2, 3]).astype(int).tolist()
            draw_label(picture, Box(left, top, 0, 0), name, "", self._scale)
        return picture

    def _colors_of(self, boxes: Table) -> UInt8Array:
        """(N, 3) colors of boxes by who sees them."""
        seen_by, bits = boxes["seen_by"], TOGETHER_DTYPE["seen_by"].itemsize * 8
        count = (seen_by[:, None] >> np.arange(bits, dtype=np.uint32) & 1).sum(axis=1)
        colors = np.full((len(boxes), 3), TEXT, np.uint8)
        colors[count == 0] = DIM
        for index, color in enumerate(self._colors.values()):
            colors[seen_by == 1 << index] = color
        return colors


class _Plan:
    """A square plan, north up, to which layers are added."""

    def __init__(self, agents_m: Float64Array, size_px: int) -> None:
        """Place the plan around (N, 2) agents, map frame."""
        low_m, high_m = agents_m.min(axis=0), agents_m.max(axis=0)
        self.center_m: Float64Array = (low_m + high_m) / 2.0
        self.side_m = max(float((high_m - low_m).max()) + 2.0 * _AROUND_M, _MIN_SIDE_M)
        self._size_px = size_px
        self._canvas = np.zeros((size_px * _OVERSAMPLING, size_px * _OVERSAMPLING, 3), np.uint8)

    def pixels(self, xy_m: Float64Array) -> Float64Array:
        """(…, 2) pixels of the finished picture of (…, 2) positions, map frame."""
        offset_m = (xy_m - self.center_m) * [1.0, -1.0]
        position_px: Float64Array = (offset_m / self.side_m + 0.5) * self._size_px
        return position_px

    def add_land(self, picture: UInt8Array) -> None:
        """Lay a dark version of a map's plan below everything."""
        dark = _LAND_STRENGTH * picture + (1.0 - _LAND_STRENGTH) * np.array(BACKGROUND)
        self._canvas[:] = cv2.resize(dark.astype(np.uint8), self._canvas.shape[1::-1])

    def add_points(self, xyz_m: Float64Array, color: Color) -> None:
        """Add (N, 3) points, map frame."""
        row_column = (self.pixels(xyz_m[:, :2]) * _OVERSAMPLING).astype(np.intp)[:, ::-1]
        inside = ((row_column >= 0) & (row_column < len(self._canvas) - 1)).all(axis=1)
        row, column = row_column[inside].T
        for down, right in np.ndindex(_OVERSAMPLING, _OVERSAMPLING):
            self._canvas[row + down, column + right] = color

    def add_boxes(self, boxes: Table, colors: UInt8Array) -> None:
        """Add the outlines and headings of boxes in (N, 3) colors."""
        corners_px = self.pixels(box_outlines(boxes, np.eye(4)))[:, [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5]]]
        for lines_px, color in zip(self._fixed(corners_px), colors.tolist(), strict=True):
            cv2.polylines(self._canvas, list(lines_px), False, color, _OVERSAMPLING, cv2.LINE_AA, _FRACTION_BITS)

    def add_agent(self, xy_m: Float64Array, color: Color, scale: float) -> None:
        """Mark an agent's position."""
        center = [int(value) for value in self._fixed(self.pixels(xy_m))]
        for radius, fill in ((8.5, BACKGROUND), (6.5, color)):
            radius_px = round(radius * scale * _OVERSAMPLING * (1 << _FRACTION_BITS))
            cv2.circle(self._canvas, center, radius_px, fill, cv2.FILLED, cv2.LINE_AA, _FRACTION_BITS)

    def picture(self) -> UInt8Array:
        """The plan as (size, size, 3) uint8 RGB."""
        picture = cv2.resize(self._canvas, (self._size_px, self._size_px), interpolation=cv2.INTER_AREA)
        return np.asarray(picture, np.uint8)

    @staticmethod
    def _fixed(pixels: Float64Array) -> AnyArray:
        """Pixels as OpenCV's fixed-point numbers on the finer canvas."""
        return np.ascontiguousarray(np.rint(pixels * _OVERSAMPLING * (1 << _FRACTION_BITS)), np.int32)


def _main_camera(scene: Scene) -> Camera | None:
    """The camera of an agent that is shown: one with color images in the scene."""
    cameras = [camera for camera in scene.view.rig.of_type(Camera) if f"{camera.name}/rgb" in scene.keys]
    return min(cameras, key=lambda camera: main_camera_rank(camera.name), default=None)


def _points_m(frame: Frame) -> Float64Array:
    """(N, 3) latest points of all lidars of an agent, map frame."""
    return np.concatenate([np.zeros((0, 3)), *_clouds_m(frame)])


def _clouds_m(frame: Frame) -> Iterator[Float64Array]:
    for lidar in frame.scene.view.rig.of_type(Lidar):
        for key in (f"{lidar.name}/points", f"{lidar.name}/semantic_points"):
            if key in frame:
                points = frame[key]
                xyz_m = np.stack([points[axis] for axis in "xyz"], axis=1).astype(np.float64)
                yield apply(frame.map_from_sensor(lidar.name), xyz_m)
                break


def _arranged(cameras: Mapping[str, Camera]) -> Block:
    """The plan, with the pictures of the agents in columns next to it."""
    plan = Tile(_PLAN, 1.0)
    tiles = [Tile(name, camera.width_px / camera.height_px) for name, camera in cameras.items()]
    columns = -(-len(tiles) // _ROWS)
    return Row([plan, *(Column(tiles[column::columns]) for column in range(columns))]) if tiles else plan
