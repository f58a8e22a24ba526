"""Draws scenes without simulating them, and lays them out as one page: a small map and the parameters of each.

A configuration and numbers of scenes enter; one self-contained HTML page leaves. The maps show the starts and
routes of the ego and of further agents, roadside units, and the hazard areas.
"""

import logging
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.latest_value import LatestValue
from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene, start_positions
from simbev_ros.scene.drawing.draw_storyboard import entity_starts_m
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.scene.streets.vehicle_route import route_line_m
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.show.maps.map_plan import MapPlan
from simbev_ros.show.pages.browsable_table import Cell, Column, browsable_table
from simbev_ros.show.pages.plans import Square
from simbev_ros.show.pages.scene_columns import CONDITIONS, condition_cells, hazard_cell, hazard_text
from simbev_ros.show.pages.web_page import web_page
from simbev_ros.show.reports.page import key_figures, section, words
from simbev_ros.show.reports.svg_drawing import Drawing, jpeg, number, ticks

MAX_SCENES = 1000
"""Maximum number of scenes on a page."""

_SIDE = 360.0
_QUALITY = 70
_MARGIN_M, _MIN_SIDE_M, _MAST_M = 40.0, 200.0, 4.0
_COLUMNS = (
    Column("", None, "map with start, route and hazards"),
    Column("scene", "text"),
    Column("map", "choice"),
    Column("split", "choice"),
    *CONDITIONS,
    Column("clouds %", None, is_number=True),
    Column("rain %", "range", is_number=True),
    Column("fog %", "range", is_number=True),
    Column("s", "range", "duration in seconds", is_number=True),
    Column("vehicles", "range", is_number=True),
    Column("pedestrians", "range", is_number=True),
    Column("hazards", "choice"),
    Column("ego", "text", "the ego's vehicle, its speed relative to the limit, and its driver"),
    Column("notes", None, "what was drawn otherwise than asked for"),
)


@dataclass(frozen=True, slots=True)
class PlannedDrawing:
    """A scene that is to be drawn."""

    scenario: Scenario
    planned: PlannedScene


@dataclass(frozen=True, eq=False, slots=True)
class DrawnScene:
    """A drawn scene with its small map as SVG text, and what was logged while it was drawn."""

    spec: SceneSpec
    map_svg: str
    notes: tuple[str, ...]


def draw_scene_with_map(work: PlannedDrawing) -> DrawnScene:
    """Draw a scene and its small map.

    Raises:
        InputError: See ``draw_scene``.
    """
    network, starts = _roads(work.scenario, work.planned.map)
    notes = _Notes()
    logger = logging.getLogger("simbev_ros.scene")
    logger.addHandler(notes)
    try:
        spec = draw_scene(work.scenario, work.planned, network, starts)
    finally:
        logger.removeHandler(notes)
    return DrawnScene(spec, _map(spec, network), tuple(dict.fromkeys(notes.messages)))


def drawn_scenes_page(title: str, scenes: Sequence[DrawnScene]) -> str:
    """HTML of the page of drawn scenes."""
    specs = [scene.spec for scene in scenes]
    counts = {
        "scene": len(specs),
        "map": len({spec.map.name for spec in specs}),
        "minute": round(sum(map(_duration_s, specs)) / 60.0, 1),
        "vehicle": sum(spec.count_of("vehicle") for spec in specs),
        "pedestrian": sum(spec.count_of("pedestrian") for spec in specs),
        "hazard": sum(len(spec.hazards) for spec in specs),
    }
    figures = [(number(count), f"{noun}{'s' * (count != 1)}") for noun, count in counts.items()]
    note = (
        "Drawn, not simulated, so rules of accept are not applied. On the maps: the ego's start (white), its route as "
        "far as it gets if nothing stops it "
        "(blue), and hazard areas (red); north is up."
    )
    if any(len(spec.agents) > 1 for spec in specs):
        note += " Other agents have starts and routes like the ego's; squares are roadside units."
    if any(spec.storyboard is not None for spec in specs):
        note += " Entities of scenarios have starts like the ego's; where they go, the scenario decides."
    table = browsable_table("Drawn scenes", _COLUMNS, [_row(scene) for scene in scenes], cards=True)
    return web_page(title, key_figures(figures), section("Scenes", table, note), ("browse.js",))


class _Notes(logging.Handler):
    """Collects the messages that are logged."""

    def __init__(self) -> None:
        super().__init__()
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.messages.append(record.getMessage())


_ROADS = LatestValue[MapSpec, tuple[RoadNetwork, StartPositions]]()


def _roads(scenario: Scenario, spec: MapSpec) -> tuple[RoadNetwork, StartPositions]:
    """The roads of a map and where actors can start on them; those of the most recent map are kept."""

    def load() -> tuple[RoadNetwork, StartPositions]:
        network = load_network(spec)
        return network, start_positions(scenario, network)

    return _ROADS.get(spec, load)


def _map(spec: SceneSpec, network: RoadNetwork) -> str:
    """SVG of the surroundings of the agents' routes and masts."""
    routes_m, masts_m = _routes_m(spec, network), _masts_m(spec)
    areas_m = [np.array(hazard.outline_m) for hazard in spec.hazards]
    starts_m = {name: route_m[:1] for name, route_m in routes_m.items()}
    if spec.storyboard is not None:
        starts_m |= {name: place_m[None] for name, place_m in entity_starts_m(spec.storyboard, network).items()}
        if spec.drive is None:
            del routes_m[spec.agents[0].name]  # it moves as the storyboard says
    shown_m = np.concatenate([*routes_m.values(), *starts_m.values(), *masts_m.values(), *areas_m])
    square = Square.around(shown_m, _MARGIN_M, _MIN_SIDE_M)
    scale, middle = _SIDE / square.side_m, _SIDE / 2.0

    def points(positions_m: AnyArray) -> str:
        on_sheet = (positions_m - square.center_m) * [scale, -scale] + middle
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in on_sheet.tolist())

    sheet = Drawing(_SIDE, _SIDE)
    plan = MapPlan(network, square.center_m, square.side_m, round(_SIDE)).picture()
    sheet.photo(0, 0, (_SIDE, _SIDE), jpeg(plan, _QUALITY))
    for hazard, area_m in zip(spec.hazards, areas_m, strict=True):
        title = f"<title>{escape(words(hazard.kind.value))}</title>"
        sheet.add(f'<polygon class="hazard" points="{points(area_m)}">{title}</polygon>')
    for kind in ("rim", "route"):
        for route_m in routes_m.values():
            sheet.add(f'<polyline class="{kind}" points="{points(route_m)}"/>')
    for name, start_m in starts_m.items():
        x, y = points(start_m).split(",")
        sheet.add(f'<circle class="start" cx="{x}" cy="{y}" r="7">{_title_of(name, spec)}</circle>')
    for name, corners_m in masts_m.items():
        sheet.add(f'<polygon class="start" points="{points(corners_m)}">{_title_of(name, spec)}</polygon>')
    bar_m = ticks(0.0, square.side_m)[1]
    sheet.block(8, _SIDE - 26, bar_m * scale + 8, 22, (250, 249, 246))
    sheet.line(12, _SIDE - 9, 12 + bar_m * scale, _SIDE - 9, "scale")
    sheet.add(f'<text class="scale" x="12" y="{_SIDE - 13}">{number(bar_m)} m</text>')
    return sheet.svg(f"Map of {spec.name}: start and route of the ego, {hazard_text(_hazards(spec))}")


def _routes_m(spec: SceneSpec, network: RoadNetwork) -> dict[str, Float64Array]:
    """(N, 2) route of each agent's vehicle, map frame, by the agent's name."""
    indices = {agent.name: agent.vehicle for agent in spec.agents}
    return {name: route_line_m(spec, network, index) for name, index in indices.items() if index is not None}


def _masts_m(spec: SceneSpec) -> dict[str, Float64Array]:
    """(4, 2) corners of the symbol of each roadside unit, map frame, by its name."""
    stations = {agent.name: agent.station for agent in spec.agents if agent.station is not None}
    square_m = _MAST_M * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return {name: square_m + np.array([station.x_m, station.y_m]) for name, station in stations.items()}


def _title_of(name: str, spec: SceneSpec) -> str:
    """Title of a symbol, if there are several."""
    return f"<title>{escape(name)}</title>" if len(spec.agents) > 1 or spec.storyboard is not None else ""


def _hazards(spec: SceneSpec) -> Counter[str]:
    return Counter(hazard.kind.value for hazard in spec.hazards)


def _row(scene: DrawnScene) -> list[Cell]:
    """Cells of a scene in the order of ``_COLUMNS``."""
    spec, weather, ego = scene.spec, scene.spec.weather, scene.spec.vehicles[0]
    driver = " reckless" if ego.reckless else " distracted" if ego.distracted else ""
    return [
        Cell("", scene.map_svg),
        Cell(spec.name, f"<b>{escape(spec.name)}</b>"),
        Cell(spec.map.name),
        Cell(spec.split),
        *condition_cells(weather, spec.final_weather),
        *(Cell(round(value)) for value in (weather.cloudiness, weather.precipitation, weather.fog_density)),
        Cell(round(_duration_s(spec), 2)),
        Cell(spec.count_of("vehicle")),
        Cell(spec.count_of("pedestrian")),
        hazard_cell(_hazards(spec)),
        Cell(f"{ego.blueprint.removeprefix('vehicle.')}, {ego.speed_factor:.2f}{driver}"),
        Cell("; ".join(scene.notes)),
    ]


def _duration_s(spec: SceneSpec) -> float:
    return spec.ticks * spec.tick_ns / NS_PER_S
