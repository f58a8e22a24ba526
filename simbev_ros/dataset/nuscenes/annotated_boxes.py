"""The boxes of a frame as nuScenes annotates them: of one size for the whole scene, with riders, hit by a sensor.

Boxes in /ego/boxes fit the object in its current pose, so those of pedestrians grow and shrink with the stride. Here
the box of an actor is that of /world/actors, which is constant, moves with the actor and contains all its poses; the
box of a ridden motorcycle or bicycle contains the rider too. The points in the new boxes are counted again, if the
clouds were recorded.
"""

import numpy as np

from simbev_ros.config.lidar import Lidar
from simbev_ros.config.radar import Radar
from simbev_ros.dataset.frame import Frame
from simbev_ros.foundation.geometry.transforms import apply, inverse
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.schema.box_points import BoxLookup
from simbev_ros.schema.map_points import map_points
from simbev_ros.schema.scene.state import map_from_actors

_UNIT_CORNERS = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)])


def annotated_boxes(frame: Frame, *, keep_unhit: bool = False) -> Table:
    """(N,) ``BOX_DTYPE`` boxes of a frame as nuScenes annotates them, in the order of ``frame["boxes"]``.

    Columns that depend on the former box, such as ``distance`` and ``difficulty``, are as recorded.

    Args:
        frame: The frame, with boxes and /world/actors.
        keep_unhit: Whether boxes without any lidar or radar point stay, which nuScenes does not annotate.
    """
    boxes = _of_constant_size(frame["boxes"], frame["world/actors"])
    lookup = BoxLookup(boxes)
    for kind, column in ((Lidar, "lidar_points"), (Radar, "radar_points")):
        clouds_m = _clouds_m(frame, kind)
        if clouds_m is not None:
            boxes[column] = np.sum([lookup.count(points_m) for points_m in clouds_m], axis=0) if clouds_m else -1
    # -1: nothing was received, so nothing is known
    return boxes if keep_unhit else boxes[np.maximum(boxes["lidar_points"], boxes["radar_points"]) != 0]


def _of_constant_size(boxes: Table, actors: Table) -> Table:
    """The boxes, those of actors with the constant size of their actor and its rider."""
    result, order = boxes.copy(), np.argsort(actors["id"])
    actors = actors[order]
    low_m, high_m = _extents(actors)
    box = np.flatnonzero(np.isin(boxes["id"], actors["id"]))
    actor = np.searchsorted(actors["id"], boxes["id"][box])
    center_m = np.einsum("nij,nj->ni", map_from_actors(actors)[:, :3, :3], (low_m + high_m) / 2.0)
    for axis, (name, size) in enumerate(zip("xyz", ("length", "width", "height"), strict=True)):
        result[name][box] = (actors[name] + center_m[:, axis])[actor]
        result[size][box] = (high_m - low_m)[actor, axis]
    return result


def _extents(actors: Table) -> tuple[Float64Array, Float64Array]:
    """Minimum and maximum x, y, z, each (N, 3), of actors with ascending ids and of their riders, actor's frame."""
    corners_m = np.stack([actors["length"], actors["width"], actors["height"]], axis=1)[:, None] * _UNIT_CORNERS
    low_m, high_m = corners_m.min(axis=1).astype(np.float64), corners_m.max(axis=1).astype(np.float64)
    map_from_actor = map_from_actors(actors)
    for rider in np.flatnonzero(np.isin(actors["parent"], actors["id"])).tolist():
        carrier = int(np.searchsorted(actors["id"], actors["parent"][rider]))
        rider_m = apply(inverse(map_from_actor[carrier]) @ map_from_actor[rider], corners_m[rider])
        low_m[carrier] = np.minimum(low_m[carrier], rider_m.min(axis=0))
        high_m[carrier] = np.maximum(high_m[carrier], rider_m.max(axis=0))
    return low_m, high_m


def _clouds_m(frame: Frame, kind: type[Lidar | Radar]) -> list[Float64Array] | None:
    """(N, 3) points of each sensor of a kind that has a cloud at the frame, map frame; None: not all were recorded."""
    keys = {sensor: _cloud_key(sensor) for sensor in frame.scene.view.rig.of_type(kind)}
    if not keys or not all(key in frame.scene.sources for key in keys.values()):
        return None
    clouds_m = []
    for sensor, key in keys.items():
        if key in frame:
            rolling = isinstance(sensor, Lidar) and sensor.rolling
            carrier = frame.scene.view.ego_row(frame["world/actors"]) if rolling else None
            clouds_m.append(map_points(frame[key], frame.map_from_sensor(sensor.name), carrier))
    return clouds_m


def _cloud_key(sensor: Lidar | Radar) -> str:
    points = isinstance(sensor, Radar) or sensor.points
    return f"{sensor.name}/points" if points else f"{sensor.name}/semantic_points"
