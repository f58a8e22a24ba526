"""Describes a scene as tables in Markdown: map, time, weather, light, traffic, hazards and rig."""

from collections import Counter
from collections.abc import Iterator, Mapping

import rerun as rr

from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.agents import AgentView
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.show.rerun.scene_log import SceneLog

SHEET = "scene"


def draw_sheet(log: SceneLog, view: AgentView) -> None:
    """Log the description of a scene."""
    log.add_static(SHEET, rr.TextDocument(scene_sheet(view), media_type=rr.MediaType.MARKDOWN))


def scene_sheet(view: AgentView) -> str:
    """Description of a scene in Markdown, as tables without headings: the view for it is low."""
    spec = view.scene
    sections = {"Scene": _scene(view), "Weather": _weather(spec), "Traffic": _traffic(spec), "Rig": _rig(view)}
    return "\n\n".join(_table(title, rows) for title, rows in sections.items())


def _table(title: str, rows: Mapping[str, str]) -> str:
    return "\n".join(
        [f"| {title} | |", "|---|---|", *(f"| {_escaped(name)} | {_escaped(text)} |" for name, text in rows.items())]
    )


def _escaped(text: str) -> str:
    """Text without effect on the table and its format; names of maps and sensors are the user's."""
    return "".join(f"\\{each}" if each in r"\`*_{}[]<>()#+!|~" else each for each in text.replace("\n", " "))


def _scene(view: AgentView) -> dict[str, str]:
    spec, vehicle = view.scene, view.vehicle
    tick_s = spec.tick_ns / NS_PER_S
    return {
        "name": spec.name,
        "map": spec.map.name,
        "split": spec.split,
        "seed": str(spec.seed),
        "length": f"{spec.ticks * tick_s:g} s, {spec.ticks} ticks of {1000 * tick_s:g} ms"
        if spec.ticks
        else f"open, ticks of {1000 * tick_s:g} ms",
        **({"agent": f"{view.agent}, one of {len(spec.agents)}"} if len(spec.agents) > 1 else {}),
        "ego": "roadside unit" if vehicle is None else f"{vehicle.blueprint}, driven by {view.spec.driver}",
    }


def _weather(spec: SceneSpec) -> dict[str, str]:
    return {name.replace("_", " "): f"{value:.4g}" for name, value in spec.weather.model_dump().items()}


def _traffic(spec: SceneSpec) -> dict[str, str]:
    blueprints = [vehicle.blueprint for vehicle in spec.vehicles] + spec.entity_blueprints("vehicle")
    kinds = Counter(name.removeprefix("vehicle.") for name in blueprints)
    return {
        "vehicles": f"{len(blueprints)}: " + ", ".join(f"{count} {name}" for name, count in kinds.most_common()),
        "pedestrians": str(spec.count_of("pedestrian")),
        "hazards": str(len(spec.hazards)),
    }


def _rig(view: AgentView) -> dict[str, str]:
    return {sensor.name: ", ".join(_facts(sensor)) for sensor in view.rig.sensors}


def _facts(sensor: object) -> Iterator[str]:
    """Kind, size and rate of a sensor."""
    yield str(getattr(sensor, "type", ""))
    if (width_px := getattr(sensor, "width_px", None)) is not None:
        yield f"{width_px} x {getattr(sensor, 'height_px', 0)} px"
    if (channels := getattr(sensor, "channels", None)) is not None:
        yield f"{channels} channels"
    if (rate_hz := getattr(sensor, "rate_hz", None)) is not None:
        yield f"{rate_hz:g} Hz"
