"""Derives the shape of a vehicle from another one: other proportions, lamps, trim and wheels.

The content of a shape file enters with a ``Reshape``; the content of the derived shape leaves, in the same layout.
"""

from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from simbev_ros.config.base import Model
from simbev_ros.foundation.tables import load_table

Stations = tuple[tuple[float, float], ...]
Data = dict[str, Any]

_LARGE_M = 0.6
"""Solids from this extent on are stretched with the body; smaller ones, such as mirrors and plates, move with it."""
_UPRIGHT_DEG = 10.0
_FACE_ROWS = ("low", "mid", "crease")
"""Lower loops of the patches that a face or tail replaces."""


class LoopChange(Model):
    """Changes of one loop of a shell; what is omitted stays.

    Attributes:
        front: x of the foremost point; the start of the loop's side moves along.
        rear: x of the rearmost point; the end of the loop's side moves along.
        rise: Added to its height.
        wide: Factor on its half width.
        nose: Exponent of the front's superellipse.
        tail: Exponent of the rear's superellipse.
    """

    front: float | None = None
    rear: float | None = None
    rise: float = 0.0
    wide: float = 1.0
    nose: float | None = None
    tail: float | None = None


class Reshape(Model):
    """How a shape differs from the one that it extends.

    Stations and factors come first; everything else is given in the new frame.

    Attributes:
        x: Stations [old, new] along the vehicle; what lies between them is stretched, what lies beyond moves.
        y: Factor on the width.
        z: Stations [old, new] of heights, as ``x``; wheels and arches are not concerned.
        wheels: Fields of ``wheels`` that differ; arches grow with the radius.
        swap: Finishes that replace others, in patches and solids.
        drop: Solids to leave out: those that have all the given values, before any change.
        styles: Names of lists of patches in variants.yaml: other faces and tails for the first shell.
        loops: Of each shell, changes of loops by name.
        shells: Of each shell, fields that replace those of the base; null removes it; further shells are added.
    """

    x: Stations = ()
    y: float = 1.0
    z: Stations = ()
    wheels: Data | None = None
    swap: dict[str, str] | None = None
    drop: tuple[Data, ...] = ()
    styles: tuple[str, ...] = ()
    loops: tuple[dict[str, LoopChange], ...] = ()
    shells: tuple[Data | None, ...] = ()


@lru_cache(maxsize=1)
def load_variants() -> dict[str, Data]:
    """Content of variants.yaml: ``styles``, and ``shapes`` by blueprint; not to be changed."""
    data: dict[str, Data] = load_table("simbev_ros.assets.actors", "shapes/variants.yaml")
    return data


def reshape_shape(base: Data, change: Reshape) -> Data:
    """Derive a shape from ``base``, which is changed in place and returned."""
    base["solids"] = [
        each for each in base.get("solids", []) if not any(given.items() <= each.items() for given in change.drop)
    ]
    if change.x or change.z or change.y != 1.0:
        _stretch(base, _Map(change.x, change.y, change.z))
    if "wheels" in base:
        before_m = base["wheels"]["radius"]
        base["wheels"] |= change.wheels or {}
        grown = base["wheels"]["radius"] / before_m
        for arch in (arch for shell in base["shells"] for arch in shell.get("arches", ())):
            arch["z"], arch["radius"] = arch["z"] * grown, arch["radius"] * grown
    shells: list[Data] = base.get("shells", [])
    for shell, changes in zip(shells, change.loops, strict=False):
        for loop in shell["loops"]:
            _change_loop(loop, shell["sides"], changes.get(loop["name"], LoopChange()))
    for index, fields in enumerate(change.shells):
        shells[index : index + 1] = [(shells[index] if index < len(shells) else {}) | (fields or {})]
    shells[:] = [shell for index, shell in enumerate(shells) if change.shells[index : index + 1] != (None,)]
    for style in change.styles:
        _restyle(shells[0], load_variants()["styles"][style])
    swap = change.swap or {}
    for painted in (*shells, *(patch for shell in shells for patch in shell.get("patches", ())), *base["solids"]):
        painted |= {key: swap.get(painted[key], painted[key]) for key in ("finish", "cap") if key in painted}
    return base


class _Map:
    """Maps points and lengths of the base to the derived shape."""

    def __init__(self, x: Stations, y: float, z: Stations) -> None:
        self.x, self.z = _piecewise(x), _piecewise(z)
        self._y = y

    def y(self, value: float) -> float:
        return value * self._y

    @property
    def axes(self) -> tuple[Callable[[float], float], ...]:
        """Functions of x, y and z."""
        return self.x, self.y, self.z


def _piecewise(stations: Stations) -> Callable[[float], float]:
    """Function that is linear between stations and keeps lengths beyond them."""
    old, new = np.array(sorted(stations) or [(0.0, 0.0)]).T

    def mapped(value: float) -> float:
        inside = float(np.clip(value, old[0], old[-1]))
        return round(float(np.interp(inside, old, new)) + value - inside, 4)

    return mapped


def _stretch(base: Data, to: _Map) -> None:
    """Stretch everything that has a position, in place."""
    if "wheels" in base:
        wheels = base["wheels"]
        wheels["axles"], wheels["half_track"] = [to.x(x) for x in wheels["axles"]], to.y(wheels["half_track"])
    for door in base.get("doors", ()):
        door["hinge"] = [to.x(door["hinge"][0]), to.y(door["hinge"][1])]
        if door.get("seat"):
            door["seat"] = [axis(value) for axis, value in zip(to.axes, door["seat"], strict=True)]
    for shell in base.get("shells", ()):
        for loop in shell["loops"]:
            loop["front"], loop["rear"] = to.x(loop["front"]), to.x(loop["rear"])
            loop["z"], loop["half"] = _curve(loop["z"], to.x, to.z), _curve(loop["half"], to.x, to.y)
        for along in _along(shell):
            along.update(
                {key: [to.x(x) for x in along[key]] for key in ("side", "sides") if isinstance(along.get(key), list)}
            )
        for arch in shell.get("arches", ()):
            arch["x"] = to.x(arch["x"])
        if shell.get("recess"):
            shell["recess"] |= {"x": [to.x(x) for x in shell["recess"]["x"]], "z": to.z(shell["recess"]["z"])}
    for solid in base["solids"]:
        _stretch_solid(solid, to)


def _along(shell: Data) -> Iterator[Data]:
    """The shell and those of its elements that list positions along the side."""
    yield shell
    for section in ("loops", "patches", "panels", "seams"):
        yield from shell.get(section, ())


def _curve(curve: Any, along: Callable[[float], float], value: Callable[[float], float]) -> Any:
    """A constant or a curve of a loop, stretched."""
    return [[along(x), value(v)] for x, v in curve] if isinstance(curve, list) else value(curve)


def _stretch_solid(solid: Data, to: _Map) -> None:
    """Move a solid, in place; what is large and upright is stretched as well."""
    at = solid.get("at", [0.0, 0.0, 0.0])
    moved = [axis(value) for axis, value in zip(to.axes, at, strict=True)]
    for name, axes in (("path", (0, 1, 2)), ("rings", (0, 1, 2)), ("polygon", (0, 2))):
        for point in solid.get(name, ()):
            for position, k in enumerate(axes):
                point[position] = round(to.axes[k](at[k] + point[position]) - moved[k], 4)
    if "size" in solid and max(map(abs, solid.get("turn", [0.0]))) < _UPRIGHT_DEG:
        for k, size in enumerate(solid["size"] if len(solid["size"]) == 3 else ()):
            if size > _LARGE_M:
                low, high = to.axes[k](at[k] - size / 2.0), to.axes[k](at[k] + size / 2.0)
                moved[k], solid["size"] = (low + high) / 2.0, [*solid["size"][:k], high - low, *solid["size"][k + 1 :]]
    if "width" in solid:
        solid["width"] = to.y(solid["width"])
    solid["at"] = moved


def _restyle(shell: Data, style: list[Data]) -> None:
    """Replace a shell's patches below the windows at the front, the rear or both by those of a style, in place."""
    kept = []
    for patch in shell["patches"]:
        if patch.get("rows", [""])[0] in _FACE_ROWS:
            for end in ("front", "rear"):
                if any(end in each for each in style):
                    patch.pop(end, None)
        if any(patch.get(section) for section in ("front", "side", "rear")):
            kept.append(patch)
    shell["patches"] = kept + [dict(each) for each in style]


def _change_loop(loop: Data, sides: list[float], change: LoopChange) -> None:
    """Change one loop, in place."""
    for end, index in (("front", 0), ("rear", -1)):
        x: float | None = getattr(change, end)
        if x is not None:
            loop["sides"] = [*(loop.get("sides") or sides)]
            loop["sides"][index] += x - loop[end]
            loop[end] = x
    loop["z"] = _curve(loop["z"], float, lambda z: z + change.rise)
    loop["half"] = _curve(loop["half"], float, lambda half: half * change.wide)
    loop |= {key: value for key in ("nose", "tail") if (value := getattr(change, key)) is not None}
