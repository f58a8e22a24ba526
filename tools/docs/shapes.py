"""docs/reference/shapes.md: every field of a shape file, from the pydantic models and their docstrings."""

import inspect
import re
from collections.abc import Iterator
from typing import Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from simbev_ros.assets.actors.doors import Door
from simbev_ros.assets.actors.figure import Figure
from simbev_ros.assets.actors.pose import Seat
from simbev_ros.assets.actors.shape import Shape, ShapePart
from simbev_ros.assets.actors.shell import Arch, Area, Loop, Panel, Patch, Recess, Seam, Shell
from simbev_ros.assets.actors.solids import AnySolid, Solid
from simbev_ros.assets.actors.variants import LoopChange, Reshape
from simbev_ros.assets.actors.wheels import Wheels
from tools.docs.markdown import GENERATED, code, sentence, slug, table

_INTRODUCTION = """# Shapes

Files in `simbev_ros/assets/actors/shapes/` describe the shapes of vehicles and people, one file per blueprint.
[Add a vehicle](../extending/vehicle.md) shows how to write one. Unknown fields are refused.

Lengths are in meters, angles in degrees. The frame is that of the actor: x forward, y left, z up, origin on the ground
below the middle of the box. The finished mesh is moved and scaled to be exactly there.

Two more fields of a file are resolved before all others:

| field | meaning |
|---|---|
| `extends` | name of another shape, the base: its solids come first, `figure` is merged, other sections replace it |
| `reshape` | only with `extends`: how the base is changed before anything is added to it. See [`reshape`](#reshape). |
| `patches` | only with `extends`: a list of lists of patches; the k-th list is added to the k-th shell of the base |

Vehicles that differ little from others have no file of their own: `shapes/variants.yaml` lists them by blueprint.
"""

_SECTIONS: dict[str, type[BaseModel]] = {
    "Top level": Shape,
    "wheels": Wheels,
    "doors": Door,
    "parts": ShapePart,
    "shells": Shell,
    "loops": Loop,
    "Areas": Area,
    "patches": Patch,
    "panels": Panel,
    "seams": Seam,
    "arches": Arch,
    "recess": Recess,
    "figure": Figure,
    "seat": Seat,
    "solids": Solid,
    "reshape": Reshape,
    "loops of reshape": LoopChange,
}
"""Heading → model, in the order of the page."""


def render_shapes() -> str:
    """The whole page."""
    parts = [GENERATED, _INTRODUCTION]
    for heading, model in _SECTIONS.items():
        parts.append(
            f"## {code(heading) if heading.islower() else heading}\n\n{_summary(model)}\n\n{_fields_of(model, heading)}"
        )
    return "\n".join(part.rstrip("\n") + "\n" for part in [*parts, _solids()])


def _summary(model: type[BaseModel]) -> str:
    """The model's docstring, without the list of attributes."""
    text = inspect.getdoc(model) or ""
    return "\n\n".join(sentence(each) for each in text.split("\n\n") if not each.startswith("Attributes:"))


def _fields_of(model: type[BaseModel], heading: str) -> str:
    """Table of the fields that a model itself declares."""
    described = dict(_described(model))
    rows = [
        (
            code(name),
            _default(model, name),
            described.get(name, "") + _choices(model, name) + _section_of(name, heading),
        )
        for name in model.__annotations__
    ]
    return table(("field", "default", "meaning"), rows) if rows else ""


def _choices(model: type[BaseModel], name: str) -> str:
    """Allowed values of a field that has a list of them."""
    annotation = model.model_fields[name].annotation
    literal = next((each for each in (annotation, *get_args(annotation)) if get_origin(each) is Literal), None)
    return f" One of {', '.join(code(value) for value in get_args(literal))}." if literal else ""


def _section_of(name: str, heading: str) -> str:
    if heading == "reshape":
        return " See [`loops of reshape`](#loops-of-reshape)." if name == "loops" else ""
    return f" See [`{name}`](#{slug(name)})." if name in _SECTIONS and name != heading else ""


def _described(model: type[BaseModel]) -> Iterator[tuple[str, str]]:
    """Yield name and description of each field in the docstring's list of attributes."""
    _, _, listed = (inspect.getdoc(model) or "").partition("Attributes:\n")
    for name, text in re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", listed, re.MULTILINE):
        yield name, text.replace("``", "`") if re.match(r"[xy]\b", text) else sentence(text)


def _default(model: type[BaseModel], name: str) -> str:
    value = model.model_fields[name].default
    if value is PydanticUndefined:
        return "required"
    if value is None or value in ((), ""):
        return "none"
    return str(list(value)) if isinstance(value, tuple) else code(str(value).lower())


def _solids() -> str:
    """Table of the kinds of solids with their own fields."""
    rows = []
    for model in get_args(get_args(AnySolid)[0]):
        kind = get_args(model.model_fields["shape"].annotation)[0]
        own = [name for name in model.__annotations__ if name != "shape"]
        fields = [
            code(name) + ("" if model.model_fields[name].is_required() else f" ({_default(model, name)})")
            for name in own
        ]
        rows.append((code(kind), ", ".join(fields), _summary(model)))
    return table(("`shape`", "further fields (default)", "what it is"), rows)
