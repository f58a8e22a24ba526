"""HTML tables of what was drawn for a scene: settings, weather, sensors and actors. A specification enters."""

from collections import Counter
from html import escape

from simbev_ros.config.weather import WEATHER_PARAMETERS
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.show.pages.scene_figures import parameter_title
from simbev_ros.show.reports.page import section, table
from simbev_ros.show.reports.svg_drawing import number


def parameter_section(spec: SceneSpec) -> str:
    """HTML of the section with all tables."""
    weather_heads, sensor_heads = ("parameter", "start", "end", "unit"), ("sensor", "type", "position, heading", "rate")
    sides = (
        [("Settings", ("setting", "value"), _settings(spec)), ("Weather", weather_heads, _weather(spec))],
        [("Sensors", sensor_heads, _sensors(spec)), ("Actors", ("blueprint", "count"), _actors(spec))],
    )
    columns = ("".join(f"<h3>{title}</h3>{table(heads, rows)}" for title, heads, rows in side) for side in sides)
    body = "".join(f'<div class="stack">{column}</div>' for column in columns)
    return section("Parameters", f'<div class="columns">{body}</div>')


def weather_ends(spec: SceneSpec, name: str) -> list[float]:
    """A parameter of the weather at the first and the last tick."""
    return [float(getattr(spec.weather_at(tick), name)) for tick in (0, spec.ticks - 1)]


def _settings(spec: SceneSpec) -> list[str]:
    ego = spec.vehicles[0]
    return [
        _row("tick", f"{spec.tick_ns / NS_PER_S:g} s"),
        _row("warm-up", f"{spec.warm_up_ticks * spec.tick_ns / NS_PER_S:g} s"),
        _row("ego", f"{ego.blueprint}, driven by {spec.agents[0].driver}"),
        _row("ego's start", f"lane {ego.start.lane}, {ego.start.s_m:.1f} m"),
        _row("ego's speed factor", f"{ego.speed_factor:.2f}"),
        _row("jaywalking", f"{100 * spec.walker_cross_factor:.0f} % of pedestrians may"),
        _row("parked vehicles", f"{100 * spec.parked_density:.0f} % of the usual number"),
        *([_row("agents", ", ".join(agent.name for agent in spec.agents))] if len(spec.agents) > 1 else []),
        _row("map's file", spec.map.path.rpartition("/")[2] or "built in"),
        _row("season", spec.map.season),
    ]


def _weather(spec: SceneSpec) -> list[str]:
    rows = []
    for name, parameter in WEATHER_PARAMETERS.items():
        ends = (f"{value:.3g}" for value in weather_ends(spec, name))
        rows.append(_row(parameter_title(name), *ends, parameter.unit))
    return rows


def _sensors(spec: SceneSpec) -> list[str]:
    rows = []
    for sensor in spec.agents[0].rig.sensors:
        pose, rate = sensor.pose, "every tick" if sensor.rate_hz is None else f"{sensor.rate_hz:g} Hz"
        place = f"{pose.x_m:g}, {pose.y_m:g}, {pose.z_m:g} m, {pose.yaw_deg:g}°"
        rows.append(_row(sensor.name, sensor.type, place, rate))
    return rows


def _actors(spec: SceneSpec) -> list[str]:
    blueprints = [vehicle.blueprint for vehicle in spec.vehicles] + [walker.blueprint for walker in spec.pedestrians]
    blueprints += spec.entity_blueprints("vehicle") + spec.entity_blueprints("pedestrian")
    counts = sorted(Counter(blueprints).items(), key=lambda item: (-item[1], item[0]))
    return [_row(name, number(count)) for name, count in counts]


def _row(head: str, *cells: str) -> str:
    return f'<th scope="row">{escape(head)}</th>' + "".join(f"<td>{escape(cell)}</td>" for cell in cells)
