"""docs/reference/configuration.md: every field of the configuration file, from the pydantic models."""

import inspect
import types
from collections.abc import Iterator
from datetime import date
from functools import cache
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
import yaml
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from simbev_ros.config.draw import Distribution
from simbev_ros.config.scenario import Scenario
from simbev_ros.config.sensor import Sensor
from tools.docs.markdown import GENERATED, code, sentence, slug, table

UNITS = {
    "_mps2_per_sqrt_s": "m/s² per √s",
    "_radps_per_sqrt_s": "rad/s per √s",
    "_rad_per_sqrt_s": "rad per √s",
    "_m_per_sqrt_m": "m per √m",
    "_per_m": "1/m",
    "_mps2": "m/s²",
    "_mps": "m/s",
    "_radps": "rad/s",
    "_mrad": "mrad",
    "_deg": "°",
    "_px": "px",
    "_hz": "Hz",
    "_db": "dB",
    "_ev": "EV",
    "_lm": "lm",
    "_mib": "MiB",
    "_kib": "KiB",
    "_electrons": "e⁻",
    "_ticks": "ticks",
    "_color_temperature_k": "K",
    "_m": "m",
    "_s": "s",
}
"""Suffix of a field's name → unit; the first one that fits holds."""

_SHARED = ("type", *Sensor.model_fields)
"""Fields that all sensors have; their rows come first."""

_INTRODUCTION = """# Configuration

One YAML file describes what is generated: scenes, rig, traffic, weather, labels and recording. Commands take its path,
or the name of a shipped file: `baselines`, `cooperative`, `demo`, `live`, `paper`, `stack` or `teams`. Unknown keys and
values out of range are refused; the message names the file, the line, the field and the allowed values.

Units are part of the names (`_m`, `_deg`, `_hz`, …). A field without a default is required. `null` stands for *none*.
Defaults follow the SimBEV paper; the shipped `config/paper.yaml` spells them out.

The smallest useful file names a map and a sensor:

```yaml
scenes:
  - {map: Blocks, train: 1}
rig:
  sensors:
    - {type: lidar, name: lidar, pose: {z_m: 1.8}}
```

`rig` is a mapping, or the path of a file with one, relative to the configuration's folder. In a rig, `defaults` maps a
sensor type to properties that all sensors of this type share.

In a scene with several agents, each is a vehicle or a roadside unit with its own rig. The first vehicle is the ego:

```yaml
scenes:
  - {map: Town05, train: 1}
agents:
  - {name: ego, rig: rigs/demo.yaml}
  - {name: van, rig: rigs/demo.yaml, blueprint: vehicle.van, near: {distance_m: 40}}
  - {name: rsu, rig: rigs/demo.yaml, mast: {junction: {signalised: true}, height_m: 5}}
```

The sections `rig`, `ego`, `frames` and `annotation` may describe the ego instead; `agents` then lists the others.
"""

_DRAWN = """## Values that are drawn

Wherever a table says *distribution*, the value may be fixed (`40`) or drawn for each scene, or for each actor where the
value belongs to an actor. `paper` stands for the paper's rule for this parameter, which may depend on other parameters.

```yaml
weather:
  cloudiness: 40                              # fixed
  precipitation: {uniform: [0, 100]}          # uniform in an interval
  wetness: {beta: [0.8, 1.0], scale: 100}     # beta(0.8, 1.0) × 100
  fog_density: {choice: [0, 0, 30]}           # one of a list
traffic:
  vehicles: {integer: [20, 80]}               # whole numbers, both ends included
  min_gap_m: {normal: [3.2, 1.0], min: 0.5, max: 10}
  pedestrian_max_speed_mps: {lognormal: [0.16, 0.64], min: 0.8, max: 8}
```
"""


def render_configuration() -> str:
    """The whole page."""
    parts = [GENERATED, _INTRODUCTION, _DRAWN, _fields_of(Distribution), "## Top level", _fields_of(Scenario)]
    for model, path in _paths().items():
        heading = "#" * (2 + path.count(".")) + " " + _title(path, model)
        parts.append(f"{heading}\n\n{_summary(model)}\n\n{_fields_of(model, path)}")
    return "\n".join(part.rstrip("\n") + "\n" for part in parts)


def documented_models() -> list[type[BaseModel]]:
    """Every model that has a table on the page."""
    return [Scenario, Distribution, *_paths()]


@cache
def _paths() -> dict[type[BaseModel], str]:
    """Paths of all models in the order of the page; of a model in several places, the shortest path, or the first."""
    sections = list(_sections(Scenario, ""))
    shortest = dict[type[BaseModel], str]()
    for path, model in sorted(sections, key=lambda section: section[0].count(".")):
        shortest.setdefault(model, path)
    return {model: path for path, model in sections if shortest[model] == path}


def _sections(model: type[BaseModel], path: str) -> Iterator[tuple[str, type[BaseModel]]]:
    """Paths of all models below a model, depth first; ``weather.final`` repeats its parent and is left out."""
    for name, field in model.model_fields.items():
        for nested in models_in(field.annotation):
            if nested is Distribution or issubclass(model, nested):
                continue
            place = f"{path}.{name}".lstrip(".")
            yield place, nested
            yield from _sections(nested, place)


def _title(path: str, model: type[BaseModel]) -> str:
    kind = _kind(model)
    return f"`{path}`: {kind}" if kind else f"`{path}`"


def _kind(model: type[BaseModel]) -> str:
    """The value of a model's ``type`` field, for sensors."""
    field = model.model_fields.get("type")
    return str(get_args(field.annotation)[0]) if field is not None else ""


def _summary(model: type[BaseModel]) -> str:
    """The model's docstring, without the list of attributes."""
    text = inspect.getdoc(model) or ""
    return "\n\n".join(sentence(each) for each in text.split("\n\n") if not each.startswith("Attributes:"))


def _fields_of(model: type[BaseModel], path: str = "") -> str:
    rows = []
    for name, field in sorted(model.model_fields.items(), key=lambda item: item[0] not in _SHARED):
        limits = _limits(field.annotation, field.metadata)
        rows.append(
            (code(name), _type(field.annotation, path, name), _unit(name), _default(field), limits, _text(field))
        )
    return table(("field", "type", "unit", "default", "allowed", "meaning"), rows)


def _text(field: FieldInfo) -> str:
    """Description of a field, or the first line of the docstring of its model."""
    if field.description:
        return sentence(field.description)
    if field.annotation is not None and get_origin(field.annotation) is Literal:
        return "Kind of sensor"
    models = models_in(field.annotation)
    if len(models) == 1 and models[0] is not Distribution:
        return sentence((inspect.getdoc(models[0]) or "").split("\n\n")[0])
    return ""


def _unit(name: str) -> str:
    return next((unit for suffix, unit in UNITS.items() if f"_{name}".endswith(suffix)), "")


def _default(field: FieldInfo) -> str:
    value = field.default
    if value is PydanticUndefined:
        return "required"
    if isinstance(value, Distribution):
        return code(_flow(value.model_dump(mode="json", exclude_defaults=True)))
    if isinstance(value, BaseModel):
        return ""
    if isinstance(value, tuple):
        return code(_flow(list(value)))
    return code(_flow(value))


def _flow(value: Any) -> str:
    """A value as YAML on one line."""
    text: str = yaml.safe_dump(value, default_flow_style=True, width=10_000, sort_keys=False)
    return text.removesuffix("...\n").strip()


def _stripped(annotation: Any) -> tuple[Any, list[Any]]:
    """An annotation without ``Annotated``, and what was attached to it."""
    if get_origin(annotation) is Annotated:
        inner, *attached = get_args(annotation)
        return inner, attached
    return annotation, []


def _is_union(annotation: Any) -> bool:
    return get_origin(annotation) in (Union, types.UnionType)


def models_in(annotation: Any) -> list[type[BaseModel]]:
    """All models that an annotation holds."""
    annotation, _ = _stripped(annotation)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for each in get_args(annotation) for model in models_in(each)]


def _type(annotation: Any, path: str, name: str) -> str:
    """A type in the words of YAML."""
    annotation, _ = _stripped(annotation)
    if annotation is Distribution:
        return "[distribution](#values-that-are-drawn)"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        if name == "final":
            return "the fields of [`weather`](#weather)"
        title = _title(_paths()[annotation], annotation)
        return f"[{_kind(annotation) or 'mapping'}](#{slug(title)})"
    if annotation is type(None):
        return "null"
    if get_origin(annotation) is Literal:
        return " or ".join(code(str(each)) for each in get_args(annotation))
    if _is_union(annotation):
        return " or ".join(dict.fromkeys(_type(each, path, name) for each in get_args(annotation)))
    if get_origin(annotation) is dict:
        return f"mapping from {' to '.join(_type(each, path, name) for each in get_args(annotation))}"
    if get_origin(annotation) in (tuple, list):
        return _list_type(get_args(annotation), path, name)
    return {float: "number", int: "integer", bool: "boolean", str: "text", date: "date"}[annotation]


def _list_type(members: tuple[Any, ...], path: str, name: str) -> str:
    if len(members) == 1 or members[-1] is Ellipsis:
        return f"list of {_type(members[0], path, name)}"
    return f"list of {len(members)} × {_type(members[0], path, name)}"


def _limits(annotation: Any, metadata: list[Any]) -> str:
    """Bounds of a value, or of the items of a list."""
    own = _bounds(metadata)
    inner, attached = _stripped(annotation)
    if attached:
        own = own or _bounds(attached)
    if own:
        return own
    members = [] if get_origin(inner) is Literal else [each for each in get_args(inner) if each is not Ellipsis]
    return next((text for text in (_limits(each, []) for each in members) if text), "")


def _bounds(metadata: list[Any]) -> str:
    """Interval, length or pattern that a field's metadata ask for."""
    low = high = ""
    words = []
    for item in metadata:
        for each in _constraints(item):
            match each:
                case annotated_types.Ge(ge=value):
                    low = f"≥ {_number(value)}"
                case annotated_types.Gt(gt=value):
                    low = f"> {_number(value)}"
                case annotated_types.Le(le=value):
                    high = f"≤ {_number(value)}"
                case annotated_types.Lt(lt=value):
                    high = f"< {_number(value)}"
                case annotated_types.MinLen(min_length=value):
                    words.append(f"length ≥ {value}")
                case annotated_types.MaxLen(max_length=value):
                    words.append(f"length ≤ {value}")
                case _ if getattr(each, "pattern", None):
                    words.append(code(str(each.pattern)))
                case _ if (support := _support(each)) is not None:
                    low, high = support
    return ", ".join(dict.fromkeys(each for each in (low, high, *words) if each))


def _constraints(item: Any) -> Iterator[Any]:
    """A constraint, or those that a nested ``Field`` holds."""
    if isinstance(item, FieldInfo):
        yield from item.metadata
    else:
        yield item


def _support(item: Any) -> tuple[str, str] | None:
    """The interval that ``config.draw.within`` checks."""
    check = getattr(item, "func", None)
    if getattr(check, "__qualname__", "") != "within.<locals>.check":
        return None
    assert check is not None
    bounds = inspect.getclosurevars(check).nonlocals
    high = bounds["high"]
    return f"≥ {_number(bounds['low'])}", "" if high == float("inf") else f"≤ {_number(high)}"


def _number(value: Any) -> str:
    return f"{value:,}".replace(",", " ") if isinstance(value, int) and abs(value) >= 10_000 else f"{value:g}"
