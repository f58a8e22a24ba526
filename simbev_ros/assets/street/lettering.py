"""Text and symbols on signs and shop fronts: flat strokes just in front of a plate, from the letters of lettering.yaml.

Frame: strokes lie in the plane x = const and face along x; for their reader, y is to the right and z is up.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array

_GRID_HEIGHT, _ADVANCE = 6.0, 5.6
_PEN = 0.95
"""Width of the strokes of letters in units of their grid."""


@lru_cache(maxsize=1024)
def text_mesh(
    finish: Finish, text: str, height_m: float, *, x_m: float = 0.0, z_m: float = 0.0, max_width_m: float = np.inf
) -> Mesh:
    """Write a line of text, centered at y = 0.

    Args:
        finish: Finish of the letters.
        text: Letters A to Z, digits, spaces and the other glyphs of lettering.yaml.
        height_m: Height of the letters.
        x_m: Plane of the letters.
        z_m: Height of their middle.
        max_width_m: The letters become narrower if the text is wider.
    """
    unit_m = height_m / _GRID_HEIGHT
    narrowed = min(1.0, max_width_m / (text_width_m(text, height_m) + 1e-9))
    lines = []
    for number, letter in enumerate(text):
        for line in glyph(letter):
            shifted = line + np.array([_ADVANCE * (number - (len(text) - 1) / 2.0) - 2.0, -_GRID_HEIGHT / 2.0])
            lines.append(shifted * unit_m * np.array([narrowed, 1.0]))
    mesh = strokes_mesh(finish, lines, _PEN * unit_m * min(1.0, 0.4 + 0.6 * narrowed), x_m)
    mesh.vertices[:, 2] += np.float32(z_m)
    return mesh


def text_width_m(text: str, height_m: float) -> float:
    """Width of a line of text with letters of a height."""
    return (len(text) - 1) * _ADVANCE * height_m / _GRID_HEIGHT + 4.0 * height_m / _GRID_HEIGHT


def strokes_mesh(finish: Finish, lines: Sequence[Float64Array], width_m: float, x_m: float = 0.0) -> Mesh:
    """Draw polylines of (N, 2) points y, z with a pen of a width, as one rectangle for each segment."""
    segments = [np.stack([line[:-1], line[1:]], axis=1) for line in lines]
    ends = np.concatenate([np.empty((0, 2, 2)), *segments])
    along = ends[:, 1] - ends[:, 0]
    along *= (width_m / 2.0) / np.maximum(np.hypot(*along.T), 1e-9)[:, None]
    aside = np.column_stack([-along[:, 1], along[:, 0]])
    start, end = ends[:, 0] - along, ends[:, 1] + along
    corners = np.stack([start - aside, end - aside, end + aside, start + aside], axis=1).reshape(-1, 2)
    faces = np.arange(0, len(corners), 4)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh.indexed(
        np.column_stack([np.full(len(corners), x_m), corners]),
        faces.reshape(-1, 3).astype(np.int32),
        normals=np.tile([1.0, 0.0, 0.0], (len(corners), 1)),
        material=finish.material,
        tag=finish.tag,
        color=finish.color,
        uv=corners,
    )


def glyph(letter: str) -> tuple[Float64Array, ...]:
    """Strokes of a letter, each (N, 2) points x, y on its grid of 4 x 6; none for a space."""
    return _glyphs().get(letter, ())


@lru_cache(maxsize=1)
def _glyphs() -> dict[str, tuple[Float64Array, ...]]:
    table = load_table("simbev_ros.assets.street", "lettering.yaml")["glyphs"]
    return {name: tuple(np.array(row, np.float64).reshape(-1, 2) for row in rows) for name, rows in table.items()}
