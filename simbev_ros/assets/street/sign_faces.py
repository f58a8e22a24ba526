"""Plates of traffic signs and private boards, from sign_faces.yaml. Frame: origin in the middle, it faces along x.

These signs are decoration: unlike the signs of the map, they have no boxes, and none of them is of a kind that has.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.graded import GradedMesh
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, boxes, cylinder
from simbev_ros.assets.palette import rgb
from simbev_ros.assets.street.lettering import strokes_mesh, text_mesh
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array

VARIANTS = 4
"""Number of variants of a plate, which differ in their words."""

_LAYER_M, _THICKNESS_M = 0.006, 0.012
_POST_M, _ROOT_M, _LOWEST_M, _GAP_M = 0.038, -0.5, 2.2, 0.03
_TWIN_POSTS_M = 1.5  # wider boards have two posts
_LOW_BOARD_M = 0.7  # foot of boards that stand behind the sidewalk
_ROUND = np.arange(16) * (np.pi / 8.0)
_SHAPES: Mapping[str, Float64Array] = {
    "circle": np.column_stack([np.cos(_ROUND), np.sin(_ROUND)]),
    "board": np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]),
    "diamond": np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]]),
    "triangle": np.array([[-1.0, -0.66], [1.0, -0.66], [0.0, 1.34]]),
}
_STEEL = (118, 122, 125)
_POLE = Finish(Material.METAL, Tag.POLE, _STEEL)
_HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])


@lru_cache(maxsize=512)
def plate(name: str, variant: int = 0) -> GradedMesh:
    """A plate with its back; the coarse mesh has its colors, without symbols and words."""
    entry = sign_table()["faces"][name]
    finishes = _Finishes(bool(entry.get("own")))
    half_m = np.array(entry["size_m"]) / 2.0
    outline = _SHAPES[entry["shape"]]
    layers = [
        _flat(finishes.of(color), outline * (half_m - inset_m), (number + 1) * _LAYER_M)
        for number, (color, inset_m) in enumerate(entry["layers"])
    ]
    x_m = (len(layers) + 1) * _LAYER_M
    marks = [
        strokes_mesh(finishes.of(color), [np.array(points).reshape(-1, 2) * half_m], pen * float(half_m.min()), x_m)
        for color, pen, *points in entry.get("strokes", ())
    ]
    rng = stream(variant, f"sign_faces.{name}")
    width_m = 1.8 * half_m[0] if entry["shape"] == "board" else 1.5 * half_m[0]
    marks += [
        text_mesh(finishes.of(color), _words(text, rng), height_m, x_m=x_m + _LAYER_M, z_m=z_m, max_width_m=width_m)
        for color, height_m, z_m, text in entry.get("text", ())
    ]
    front, coarse = Mesh.merge([*layers, *marks]), Mesh.merge(layers)
    if entry.get("twin"):
        shift = np.eye(4)
        shift[0, 3] = -_THICKNESS_M
        return GradedMesh.merge(
            [GradedMesh(mesh, stand_in) for mesh, stand_in in ((front, coarse), _turned(front, coarse, shift))]
        )
    back = _flat(finishes.back, outline[::-1] * half_m, -_THICKNESS_M)
    return GradedMesh(Mesh.merge([front, back]), Mesh.merge([coarse, back]))


@lru_cache(maxsize=1024)
def sign_post(names: tuple[str, ...], variant: int = 0) -> GradedMesh:
    """Plates above each other on a post, all of them above the heads of pedestrians; origin at the foot."""
    heights_m = [_height_m(name) for name in names]
    z_m, parts = _LOWEST_M, []
    for name, height_m in reversed(list(zip(names, heights_m, strict=True))):
        parts.append(shift_graded(plate(name, variant), _POST_M + _THICKNESS_M, 0.0, z_m + height_m / 2.0))
        z_m += height_m + _GAP_M
    post = cylinder(_POLE, (0.0, 0.0, _ROOT_M), (0.0, 0.0, z_m), _POST_M, segments=6)
    return GradedMesh.merge([GradedMesh(post, post), *parts])


@lru_cache(maxsize=256)
def board(name: str, variant: int = 0) -> GradedMesh:
    """A board on one or two posts that stands behind a sidewalk; origin at the foot."""
    width_m, height_m = sign_table()["faces"][name]["size_m"]
    low_m = 2.0 if width_m > _TWIN_POSTS_M else 0.25 if height_m > 2.0 else _LOW_BOARD_M
    y_m = np.array([-0.35, 0.35]) * width_m if width_m > _TWIN_POSTS_M else np.zeros(1)
    top_m = low_m + height_m
    posts = boxes(
        _POLE,
        np.tile([0.07, 0.09, top_m - _ROOT_M], (len(y_m), 1)),
        np.column_stack([np.zeros(len(y_m)), y_m, np.full(len(y_m), (top_m + _ROOT_M) / 2.0)]),
    )
    out_m = 0.035 + _THICKNESS_M
    face = shift_graded(plate(name, variant), out_m, 0.0, low_m + height_m / 2.0)
    if sign_table()["faces"][name].get("twin"):
        face = shift_graded(face, -out_m, 0.0, 0.0)
    return GradedMesh.merge([GradedMesh(posts, posts), face])


def shift_graded(mesh: GradedMesh, x_m: float, y_m: float, z_m: float) -> GradedMesh:
    """Copy of a mesh, moved."""
    pose = np.eye(4)
    pose[:3, 3] = x_m, y_m, z_m
    return GradedMesh(mesh.mesh.transform(pose), mesh.coarse.transform(pose))


def draw_choice(entry: Mapping[str, Any], american: bool, rng: np.random.Generator) -> tuple[str, ...]:
    """Draw plates from the weighted choices of a row of sign_faces.yaml, in one of two countries."""
    rows: Sequence[Sequence[Any]] = entry["us"] if american and "us" in entry else entry["choices"]
    weights = np.array([row[0] for row in rows], np.float64)
    return tuple(rows[int(rng.choice(len(rows), p=weights / weights.sum()))][1:])


@lru_cache(maxsize=1)
def sign_table() -> Mapping[str, Any]:
    """The tables of sign_faces.yaml."""
    return load_table("simbev_ros.assets.street", "sign_faces.yaml")


class _Finishes:
    """Finishes of plates in the colors of the table: reflective, except on private ones."""

    def __init__(self, own: bool) -> None:
        self._material = Material.PLASTIC if own else Material.PLATE
        self.back = Finish(Material.METAL, Tag.TRAFFIC_SIGN, _STEEL)

    def of(self, color: str) -> Finish:
        """Finish in a color."""
        return Finish(self._material, Tag.TRAFFIC_SIGN, rgb(int(sign_table()["colors"][color])))


def _height_m(name: str) -> float:
    return float(sign_table()["faces"][name]["size_m"][1])


def _words(text: str, rng: np.random.Generator) -> str:
    """A text with each {name} replaced by a word of that list."""
    for name, words in sign_table()["words"].items():
        while f"{{{name}}}" in text:
            text = text.replace(f"{{{name}}}", words[int(rng.integers(len(words)))], 1)
    return text


def _turned(mesh: Mesh, coarse: Mesh, shift: Float64Array) -> tuple[Mesh, Mesh]:
    """The same front on the other side."""
    pose = shift @ _HALF_TURN
    return mesh.transform(pose), coarse.transform(pose)


def _flat(finish: Finish, outline_m: Float64Array, x_m: float) -> Mesh:
    """Convex plate from (N, 2) corners y, z; it faces along x if they are counter-clockwise there, else against it."""
    count = len(outline_m)
    a, b = outline_m[1] - outline_m[0], outline_m[2] - outline_m[0]
    faces = np.column_stack([np.zeros(count - 2), np.arange(1, count - 1), np.arange(2, count)])
    return Mesh.indexed(
        np.column_stack([np.full(count, x_m), outline_m]),
        faces.astype(np.int32),
        normals=np.tile([np.sign(a[0] * b[1] - a[1] * b[0]), 0.0, 0.0], (count, 1)),
        material=finish.material,
        tag=finish.tag,
        color=finish.color,
        uv=outline_m,
    )
