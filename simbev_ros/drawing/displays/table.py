"""Table of the displays that are ROS messages: of which kinds of data each topic is made, and by which function.

Nodes publish topics that have a subscriber, and a Foxglove server of bags makes them from recorded messages;
both read this table. To add a display, add a row.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from simbev_ros.drawing.displays.box_markers import box_markers, world_markers
from simbev_ros.drawing.displays.detections import (
    DETECTIONS_2D,
    DETECTIONS_3D,
    detections_2d,
    detections_3d,
)
from simbev_ros.drawing.displays.ego_path import path_message
from simbev_ros.drawing.displays.grids import occupancy_grid
from simbev_ros.drawing.displays.image_boxes import image_boxes
from simbev_ros.drawing.displays.map_markers import map_markers
from simbev_ros.drawing.displays.messages import (
    CLOUD,
    COMPRESSED_IMAGE,
    DIAGNOSTICS,
    GRID,
    IMAGE,
    IMAGE_MARKER,
    MARKERS,
    PATH,
    rgb_image,
)
from simbev_ros.drawing.displays.pictures import color_picture, compressed_picture
from simbev_ros.drawing.displays.status import EVENT, LANE, WEATHER, status
from simbev_ros.drawing.displays.table_points import table_points
from simbev_ros.drawing.kinds import Kind
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray, Table, UInt16Array
from simbev_ros.schema.palette import bev_color
from simbev_ros.schema.scene.agents import AgentView
from simbev_ros.schema.v2x import boxes_of_messages


@dataclass(frozen=True, slots=True)
class Moment:
    """Circumstances of the data that are drawn.

    Attributes:
        stamp_ns: Their stamp.
        frame: The camera's optical frame for data of a camera, otherwise the ego frame.
        view: The scene as the agent sees it.
    """

    stamp_ns: int
    frame: str
    view: AgentView


@dataclass(frozen=True, slots=True)
class MessageDisplay:
    """A row of the table.

    Attributes:
        topic: Name of the topic in the agent's namespace, with a leading slash the whole name.
        type_name: ROS type of its messages.
        kinds: Kinds of data that it shows. Each message of the first kind leads to a message of the display.
        make: Makes a serialized message of a moment and the data of each kind: tables, images as arrays, records as
            dictionaries; of odometry the poses up to now.
        keeps_newest: Whether a late subscriber gets the newest message at once, as for maps in ROS.
    """

    topic: str
    type_name: str
    kinds: tuple[Kind, ...]
    make: Callable[..., bytes]
    keeps_newest: bool = False


def _points(at: Moment, *tables: Table) -> bytes:
    return table_points(tables[-1], at.stamp_ns)


def _detections(at: Moment, messages: Table) -> bytes:
    return detections_3d(boxes_of_messages(messages), at.stamp_ns)


def _grid(index: int, at: Moment, labels: UInt16Array, actors: Table) -> bytes:
    ego = at.view.ego_row(actors)
    rpy_rad = [float(ego[name]) for name in ("roll", "pitch", "yaw")]
    covered = (_bev_labels(labels) >> index & 1).astype(bool)
    return occupancy_grid(covered, at.view.annotation.bev.grid, at.stamp_ns, at.frame, rpy_rad)


def _bev_labels(labels: AnyArray) -> UInt16Array:
    if labels.dtype != "uint16" or labels.ndim != 2:
        raise ValueError(f"its grid is of {labels.dtype} with {labels.ndim} axes, not of mono16")
    return labels


def _pictures(kind: Kind) -> tuple[MessageDisplay, MessageDisplay]:
    """Rows of a modality that no viewer can color by itself."""
    modality = kind.rpartition("/")[2]
    color, topic = partial(color_picture, modality), f"{kind}/color"
    return (
        MessageDisplay(topic, IMAGE, (kind,), lambda at, image: rgb_image(color(image), at.stamp_ns, at.frame)),
        MessageDisplay(
            f"{topic}/compressed",
            COMPRESSED_IMAGE,
            (kind,),
            lambda at, image: compressed_picture(color(image), at.stamp_ns, at.frame),
        ),
    )


MESSAGE_DISPLAYS: tuple[MessageDisplay, ...] = (
    MessageDisplay(
        "/world/markers",
        MARKERS,
        (Kind.SIGNALS, Kind.ACTORS, Kind.LIGHTS),
        lambda at, signals, actors, lamps: world_markers(actors, signals, lamps, at.stamp_ns),
    ),
    MessageDisplay("/world/actors/points", CLOUD, (Kind.ACTORS,), _points),
    MessageDisplay("/world/signals/points", CLOUD, (Kind.SIGNALS,), _points),
    MessageDisplay("/world/lights/points", CLOUD, (Kind.ACTORS, Kind.LIGHTS), _points),
    MessageDisplay(
        "/world/weather/status",
        DIAGNOSTICS,
        (Kind.WEATHER,),
        lambda at, weather: status(WEATHER, weather, at.stamp_ns),
    ),
    MessageDisplay(
        "/world/events/status",
        DIAGNOSTICS,
        (Kind.EVENTS,),
        lambda at, event: status(EVENT, event, at.stamp_ns),
    ),
    MessageDisplay("path", PATH, (Kind.ODOMETRY,), lambda at, poses: path_message(poses)),
    MessageDisplay("boxes/markers", MARKERS, (Kind.BOXES,), lambda at, boxes: box_markers(boxes, at.stamp_ns)),
    MessageDisplay("boxes/points", CLOUD, (Kind.BOXES,), _points),
    MessageDisplay("detections", DETECTIONS_3D, (Kind.BOXES,), lambda at, boxes: detections_3d(boxes, at.stamp_ns)),
    MessageDisplay(
        "bev/color",
        IMAGE,
        (Kind.GRID,),
        lambda at, labels: rgb_image(bev_color(_bev_labels(labels)), at.stamp_ns, at.frame),
    ),
    MessageDisplay("hd_map/status", DIAGNOSTICS, (Kind.LANE,), lambda at, lane: status(LANE, lane, at.stamp_ns)),
    MessageDisplay(
        "vector_map/markers", MARKERS, (Kind.VECTOR_MAP,), lambda at, roads: map_markers(roads, at.stamp_ns)
    ),
    *(
        MessageDisplay(f"bev/{name}/grid", GRID, (Kind.GRID, Kind.ACTORS), partial(_grid, index), keeps_newest=True)
        for index, name in enumerate(BEV_CLASSES)
    ),
    MessageDisplay(
        "{sensor}/boxes/markers",
        IMAGE_MARKER,
        (Kind.VIEWS,),
        lambda at, views: image_boxes(views, at.stamp_ns, at.frame),
    ),
    MessageDisplay(
        "{sensor}/detections",
        DETECTIONS_2D,
        (Kind.VIEWS,),
        lambda at, views: detections_2d(views, at.stamp_ns, at.frame),
    ),
    MessageDisplay(
        "{sensor}/detections/amodal",
        DETECTIONS_2D,
        (Kind.VIEWS,),
        lambda at, views: detections_2d(views, at.stamp_ns, at.frame, "amodal_"),
    ),
    *_pictures(Kind.SEMANTIC),
    *_pictures(Kind.INSTANCE),
    *_pictures(Kind.DEPTH),
    *_pictures(Kind.FLOW),
    MessageDisplay("/v2x/{agent}/detections", DETECTIONS_3D, (Kind.V2X_SENT,), _detections),
    MessageDisplay("v2x/detections", DETECTIONS_3D, (Kind.V2X_ARRIVED,), _detections),
)
