"""2D boxes over the images of a camera, as visualization_msgs/ImageMarker."""

import numpy as np

from simbev_ros.drawing.displays.messages import IMAGE_MARKER, build, color, points, serialize, stamped
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Float64Array, Int64Array, Table
from simbev_ros.schema.palette import class_color

_LINE_LIST = 2
_SIDES = ("left", "top", "right", "bottom")
_LINE_PX = 1.5
_DASHES = 6
"""Number of dashes along a side of a dashed box."""
_HIDDEN_ALPHA = 0.6


def image_boxes(views: Table, stamp_ns: int, frame: str) -> bytes:
    """ImageMarker with the boxes of a camera's view: a list of lines, with a color for each line, that of the class.

    A box around the visible pixels of an object is solid, one around the silhouette of a hidden object is dashed.

    Args:
        views: (K,) ``VIEW_DTYPE``.
        stamp_ns: Stamp of the image.
        frame: The camera's optical frame.
    """
    hidden = views["visible_px"] == 0
    solid, owner = _outlines(views[~hidden], "", 1)
    dashed, hidden_owner = _outlines(views[hidden], "amodal_", _DASHES)
    names = [BOX_CLASSES[number] for number in views["class"].tolist()]
    whole, faded = ([name for name, is_hidden in zip(names, hidden, strict=True) if is_hidden == of] for of in (0, 1))
    colors = [color(class_color(whole[row])) for row in owner.tolist()]
    colors += [color(class_color(faded[row]), _HIDDEN_ALPHA) for row in hidden_owner.tolist()]
    ends_px = np.concatenate([solid, dashed]).reshape(-1, 2)
    return serialize(
        build(
            IMAGE_MARKER,
            header=stamped(stamp_ns, frame),
            ns="boxes",
            type=_LINE_LIST,
            scale=_LINE_PX,
            outline_color=color((255, 255, 255)),
            points=points(np.pad(ends_px, ((0, 0), (0, 1)))),
            outline_colors=colors,
        )
    )


def _outlines(views: Table, prefix: str, dashes: int) -> tuple[Float64Array, Int64Array]:
    """Lines along the sides of boxes.

    Returns:
        (L, 2, 2) x and y of both ends, px, pixel centers at integers, and (L,) the row of each line's box.
    """
    left, top, right, bottom = (views[f"{prefix}{side}"].astype(np.float64) for side in _SIDES)
    corners = np.stack(
        [np.stack(each, axis=-1) for each in ((left, top), (right, top), (right, bottom), (left, bottom))], axis=1
    )
    begin, end = corners[:, :, None, None], np.roll(corners, -1, axis=1)[:, :, None, None]
    share = np.linspace(0.0, 1.0, 2 * dashes).reshape(1, 1, dashes, 2, 1)
    dashes_px = begin + share * (end - begin)
    return dashes_px.reshape(-1, 2, 2), np.repeat(np.arange(len(views)), 4 * dashes)
