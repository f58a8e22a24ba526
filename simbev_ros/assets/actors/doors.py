"""Doors of vehicles: panels of a shell, hinged at their front edges, with dark niches and seats behind them."""

import numpy as np

from simbev_ros.assets.actors.actor_model import Part
from simbev_ros.assets.actors.solids import Box, Solid
from simbev_ros.config.base import Model
from simbev_ros.foundation.types import BoolArray, Float64Array

_OPENING_RAD = float(np.radians(65.0))
_THICKNESS_M = 0.06
_MIDDLE_M = 0.06
"""Half the thickness of the wall between the niches of both sides."""


class Door(Model):
    """Pair of hinged doors, left and right; they open by 65 degrees.

    Doors count front left, front right, rear left, rear right: door k is bit k of the column ``doors``, and the
    blueprint's field ``doors`` is their number.

    Attributes:
        name: Name that panels refer to; the parts are called ``door <name> left`` and ``door <name> right``.
        hinge: x and y of the left hinge.
        seat: x, y, z where back and cushion of the seat behind the left door meet; without it, no seat.
    """

    name: str
    hinge: tuple[float, float]
    seat: tuple[float, float, float] | None = None


def door_part(door: str, side: str) -> str:
    """Name of a door's rigid part."""
    return f"door {door} {side}"


def door_parts(doors: tuple[Door, ...]) -> list[Part]:
    """Rigid parts of all doors, pair by pair, left then right: the order of the bits in the ``doors`` column."""
    return [
        Part(
            name=door_part(door.name, side),
            parent=0,
            pivot_m=(door.hinge[0], sign * door.hinge[1], 0.0),
            door=2 * pair + int(sign < 0.0),
            opening_rad=-sign * _OPENING_RAD,
        )
        for pair, door in enumerate(doors)
        for side, sign in (("left", 1.0), ("right", -1.0))
    ]


def seats(doors: tuple[Door, ...]) -> list[Solid]:
    """Cushion, back and headrest behind each door that has a seat."""
    solids: list[Solid] = []
    for x, y, z in (door.seat for door in doors if door.seat):
        for size, at, pitch in (
            ((0.50, 0.46, 0.14), (x + 0.22, y, z), -6.0),
            ((0.12, 0.46, 0.60), (x - 0.07, y, z + 0.28), -12.0),
            ((0.08, 0.24, 0.17), (x - 0.16, y, z + 0.67), -12.0),
        ):
            solids.append(Box(shape="box", finish="seat", size=size, at=at, turn=(0.0, pitch, 0.0), mirrored=True))
    return solids


def insides(panel: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Surfaces that an open door reveals: its inner side, and the niche behind it.

    Args:
        panel: (Q, 4, 3) cells of the door's outer surface, counter-clockwise seen from outside.

    Returns:
        (Q + E, 4, 3) the inner skin, cell by cell, then the door's edges; (Q + E, 4, 3) the walls of the niche.
    """
    side = np.sign(panel[..., 1].mean())
    edges = panel[:, [[0, 1], [1, 2], [2, 3], [3, 0]]].reshape(-1, 2, 3)
    edges = edges[_is_border(edges)]
    inner, inner_edges = (points - [0.0, side * _THICKNESS_M, 0.0] for points in (panel, edges))
    deep, deep_edges = panel.copy(), edges.copy()
    deep[..., 1] = deep_edges[..., 1] = side * _MIDDLE_M
    leaf = np.stack([edges[:, 1], edges[:, 0], inner_edges[:, 0], inner_edges[:, 1]], axis=1)
    walls = np.stack([edges[:, 0], edges[:, 1], deep_edges[:, 1], deep_edges[:, 0]], axis=1)
    return np.concatenate([inner[:, ::-1], leaf]), np.concatenate([deep, walls])


def _is_border(edges: Float64Array) -> BoolArray:
    """(E,) whether no neighboring cell shares each of (E, 2, 3) directed edges in the opposite direction."""
    _, joined = np.unique(np.round(edges.reshape(-1, 3), 6), axis=0, return_inverse=True)
    start, end = joined.reshape(-1, 2).astype(np.int64).T
    count = joined.max() + 1
    return np.isin(start * count + end, end * count + start, invert=True)
