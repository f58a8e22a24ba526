"""Meshes of traffic signs (Vienna Convention, limits in km/h). Frame: origin at the foot, the sign faces along x."""

from functools import lru_cache

import numpy as np
import shapely

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, box, boxes, cylinder, extrusion
from simbev_ros.assets.palette import Color
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.roads.layout import Sign, SignKind

_STEEL = (104, 108, 111)
_POLE = Finish(Material.METAL, Tag.POLE, _STEEL)
_BACK = Finish(Material.METAL, Tag.TRAFFIC_SIGN, _STEEL)
_RED, _WHITE, _BLACK = (
    Finish(Material.PLATE, Tag.TRAFFIC_SIGN, color) for color in ((190, 28, 32), (240, 240, 238), (20, 20, 22))
)
_FACE_Z_M, _ROOT_M = 2.6, -0.5
_LAYER_M = 0.006
_LOOKS_ALONG_X = np.array([[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def sign_mesh(sign: Sign) -> Mesh:
    """Mesh of a sign of the map, on its post."""
    if sign.kind is SignKind.SPEED_LIMIT:
        return speed_sign(round(sign.speed_mps * 3.6))
    return stop_sign() if sign.kind is SignKind.STOP else yield_sign()


@lru_cache(maxsize=32)
def speed_sign(limit_kmh: int) -> Mesh:
    """A speed limit sign: black digits on white in a red ring."""
    digits = [int(digit) for digit in str(limit_kmh)]
    width_m = 0.2 if len(digits) < 3 else 0.16
    figures = [_figure(digit, (k - (len(digits) - 1) / 2.0) * width_m, width_m / 0.2) for k, digit in enumerate(digits)]
    circle = shapely.Point(0.0, 0.0).buffer(1.0, quad_segs=4)
    return Mesh.merge(
        [
            _post(),
            _plate(_BACK, circle, 0.31, 0),
            _plate(_RED, circle, 0.32, 1),
            _plate(_WHITE, circle, 0.25, 2),
            *figures,
        ]
    )


@lru_cache(maxsize=1)
def stop_sign() -> Mesh:
    """A stop sign: a red octagon with white letters."""
    turn = (np.arange(8) + 0.5) * np.pi / 4.0
    octagon = shapely.Polygon(np.column_stack([np.cos(turn), np.sin(turn)]))
    plates = [_plate(_BACK, octagon, 0.4, 0), _plate(_WHITE, octagon, 0.42, 1), _plate(_RED, octagon, 0.385, 2)]
    return Mesh.merge([_post(), *plates, *_word("STOP")])


@lru_cache(maxsize=1)
def yield_sign() -> Mesh:
    """A yield sign: a white triangle on its tip with a red border."""
    turn = np.array([-0.5, 1.0 / 6.0, 5.0 / 6.0]) * np.pi
    triangle = shapely.Polygon(np.column_stack([np.cos(turn), np.sin(turn)]))
    return Mesh.merge(
        [_post(), _plate(_BACK, triangle, 0.45, 0), _plate(_RED, triangle, 0.47, 1), _plate(_WHITE, triangle, 0.29, 2)]
    )


@lru_cache(maxsize=4)
def street_name_sign(color: Color) -> Mesh:
    """A street name sign: two plates at right angles on a post."""
    plate_, letters = (Finish(Material.PLATE, Tag.TRAFFIC_SIGN, shade) for shade in (color, (232, 232, 228)))
    strokes = np.array([(0.14 + 0.11 * k, 0.0, 2.75) for k in range(6)])
    return Mesh.merge(
        [
            cylinder(_POLE, (0.0, 0.0, _ROOT_M), (0.0, 0.0, 2.9), 0.035, segments=6),
            box(plate_, (0.95, 0.02, 0.2), (0.42, 0.0, 2.75)),
            boxes(letters, np.tile((0.06, 0.03, 0.09), (6, 1)), strokes),
            box(plate_, (0.02, 0.95, 0.2), (0.0, 0.42, 2.5)),
            boxes(letters, np.tile((0.03, 0.06, 0.09), (6, 1)), strokes[:, [1, 0, 2]] - [0.0, 0.0, 0.25]),
        ]
    )


def _post() -> Mesh:
    return cylinder(_POLE, (0.0, 0.0, _ROOT_M), (0.0, 0.0, _FACE_Z_M + 0.25), 0.035, segments=6)


def _plate(finish: Finish, outline: shapely.Polygon, size_m: float, layer: int) -> Mesh:
    """A flat plate from an outline of unit radius; each layer lies in front of the previous one."""
    scaled = shapely.transform(outline, lambda xy: xy * size_m)
    near_m = 0.03 + layer * _LAYER_M
    raised = extrusion(finish, scaled, near_m, near_m + _LAYER_M + 0.006, crease_deg=0.0).transform(_LOOKS_ALONG_X)
    return raised.transform(_at_face())


def _at_face() -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    pose = np.eye(4)
    pose[2, 3] = _FACE_Z_M
    return pose


def _figure(value: int, y_m: float, scale: float) -> Mesh:
    """Seven-segment digit, 0.28 m high, read from +x; the reader's right is +y."""
    upright, level = (0.006, 0.03, 0.14), (0.006, 0.12 * scale, 0.03)
    strokes = {
        "a": (level, 0.0, 0.125),
        "b": (upright, 0.05 * scale, 0.065),
        "c": (upright, 0.05 * scale, -0.065),
        "d": (level, 0.0, -0.125),
        "e": (upright, -0.05 * scale, -0.065),
        "f": (upright, -0.05 * scale, 0.065),
        "g": (level, 0.0, 0.0),
    }
    chosen = [strokes[segment] for segment in _SEGMENTS[value]]
    x_m = 0.03 + 3 * _LAYER_M + 0.006
    centers = np.array([(x_m, y_m + side_m, _FACE_Z_M + up_m) for _, side_m, up_m in chosen])
    return boxes(_BLACK, np.array([size for size, _, _ in chosen]), centers)


def _word(text: str) -> list[Mesh]:
    """Letters made of strokes, 0.2 m high."""
    x_m = 0.03 + 3 * _LAYER_M + 0.006
    pieces = []
    for k, letter in enumerate(text):
        y_m = (k - (len(text) - 1) / 2.0) * 0.155
        sizes, centers = zip(*_LETTERS[letter], strict=True)
        sizes_m = np.array([(0.006, width, height) for width, height in sizes])
        centers_m = np.array([(x_m, y_m + side, _FACE_Z_M + up) for side, up in centers])
        pieces.append(boxes(_WHITE, sizes_m, centers_m))
    return pieces


_SEGMENTS = ("abcdef", "bc", "abdeg", "abcdg", "bcfg", "acdfg", "acdefg", "abc", "abcdefg", "abcdfg")
_BAR, _STEM, _HALF = (0.11, 0.03), (0.03, 0.2), (0.03, 0.1)
_LETTERS = {
    "S": (
        (_BAR, (0.0, 0.085)),
        (_BAR, (0.0, 0.0)),
        (_BAR, (0.0, -0.085)),
        (_HALF, (-0.04, 0.045)),
        (_HALF, (0.04, -0.045)),
    ),
    "T": ((_BAR, (0.0, 0.085)), (_STEM, (0.0, 0.0))),
    "O": ((_BAR, (0.0, 0.085)), (_BAR, (0.0, -0.085)), (_STEM, (-0.04, 0.0)), (_STEM, (0.04, 0.0))),
    "P": ((_BAR, (0.0, 0.085)), (_BAR, (0.0, 0.0)), (_STEM, (-0.04, 0.0)), (_HALF, (0.04, 0.045))),
}
