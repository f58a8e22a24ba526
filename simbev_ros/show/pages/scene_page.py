"""Writes the page of one recorded scene: video, map with the ego's path, curves over time, and all parameters.

A scene and its facts enter; a folder with the page, its pictures and its video leaves.
"""

from dataclasses import dataclass
from functools import lru_cache
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from rich.filesize import decimal

from simbev_ros.config.weather import WEATHER_PARAMETERS
from simbev_ros.dataset import Dataset, Scene, open_dataset
from simbev_ros.dataset.statistics import SceneFacts
from simbev_ros.evaluation.conditions import daytime_of, weather_of
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.files.whole_files import write_whole
from simbev_ros.foundation.latest_value import LatestValue
from simbev_ros.foundation.object_store.object_path import AnyPath
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.recording.reader import SceneBag
from simbev_ros.schema.palette import class_color, rgb_channels
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.show.pages.charts import Chart, Series, curves, figure
from simbev_ros.show.pages.plans import Square, plan_picture
from simbev_ros.show.pages.scene_columns import hazard_text
from simbev_ros.show.pages.scene_figures import parameter_title
from simbev_ros.show.pages.scene_media import PLAN, SHEET, VIDEO, is_newer, write_media
from simbev_ros.show.pages.scene_parameters import parameter_section, weather_ends
from simbev_ros.show.pages.web_page import facts, web_page
from simbev_ros.show.reports.page import section, words
from simbev_ros.show.reports.svg_drawing import css
from simbev_ros.simulation.replay.replay import build_recorded_roads

PAGE = "index.html"

_MARGIN_M, _MIN_SIDE_M = 50.0, 160.0
_MAP_PX = 520
_PATH, _HAZARD = (20, 110, 190), (214, 60, 40)
_CLOSED = {"type": "scatter", "mode": "lines", "fill": "toself", "fillcolor": "rgba(214,60,40,0.35)"}


@dataclass(frozen=True, eq=False, slots=True)
class ScenePage:
    """The page of a scene that is to be written.

    Attributes:
        dataset: The dataset's folder, or the bag.
        bag: The scene's bag.
        facts: Facts about the scene.
        folder: Folder of the page.
        home: Address of the dataset's page, relative to the folder.
        plotly: Address of Plotly's script, relative to the folder.
        previous: Name of the scene before this one; empty: this is the first.
        following: Name of the scene after this one; empty: this is the last.
        video: Whether there is to be a video.
    """

    dataset: AnyPath
    bag: AnyPath
    facts: SceneFacts
    folder: Path
    home: str
    plotly: str
    previous: str
    following: str
    video: bool


@dataclass(frozen=True, slots=True)
class PlanPicture:
    """A picture of a part of a scene's map that is to be written."""

    dataset: AnyPath
    bag: AnyPath
    square: Square
    file: Path


def write_scene_page(work: ScenePage) -> bool:
    """Write the page of a scene with its pictures and its video; those that are newer than the bag are kept.

    Returns:
        Whether the scene has pictures.

    Raises:
        BagError: The bag is damaged.
        OSError: A file cannot be written.
    """
    scene = _scene(work.dataset, work.bag)
    has_pictures = write_media(work.bag, work.folder, video=work.video)
    known = work.facts.ego_m
    square = Square.around(known, _MARGIN_M, _MIN_SIDE_M) if len(known) else None
    plan = square is not None and write_plan(PlanPicture(work.dataset, work.bag, square, work.folder / PLAN))
    body = (
        _screen(work, has_pictures)
        + _curves(work.facts, scene.spec, square, has_plan=plan)
        + parameter_section(scene.spec)
    )
    page = web_page(work.facts.name, _head(work), body, ("charts.js",), work.plotly)
    write_whole(work.folder / PAGE, page.encode())
    return has_pictures


def write_plan(work: PlanPicture) -> bool:
    """Write a picture of a part of a scene's map, unless it is newer than the bag.

    Returns:
        Whether there is one; not if the roads cannot be built from what the bag holds.
    """
    if is_newer(work.file, work.bag):
        return True
    try:
        network = _roads(work.bag, _scene(work.dataset, work.bag).spec.map.model_dump_json())
    except SimbevError:  # the page says so
        return False
    write_whole(work.file, plan_picture(network, work.square))
    return True


@lru_cache(maxsize=1)
def _open(dataset: AnyPath) -> Dataset:
    return open_dataset(dataset, threads=1)


def _scene(dataset: AnyPath, bag: AnyPath) -> Scene:
    return next(each for each in _open(dataset).scenes if each.path == bag)


_ROADS = LatestValue[str, RoadNetwork]()


def _roads(bag: AnyPath, map_spec: str) -> RoadNetwork:
    """The roads of a bag's map; those of the most recent map are kept."""

    def load() -> RoadNetwork:
        with SceneBag(bag) as opened:
            return load_network(build_recorded_roads(opened))

    return _ROADS.get(map_spec, load)


def _head(work: ScenePage) -> str:
    """HTML of the links to other pages and of the facts in a nutshell."""
    links = [f'<a href="{quote(work.home)}">← All scenes</a>']
    for name, text in ((work.previous, "← {}"), (work.following, "{} →")):
        if name:
            links.append(f'<a href="../{quote(name)}/{PAGE}">{escape(text.format(name))}</a>')
    known = work.facts
    pairs = [
        ("map", known.map),
        ("split", known.split),
        ("seed", str(known.seed)),
        ("duration", f"{known.duration_s:g} s, {known.frames} frames"),
        ("light and weather", f"{daytime_of(known.weather)}, {weather_of(known.weather)}"),
        ("path of the ego", f"{known.distance_m:.0f} m"),
        ("actors", f"{plural(known.vehicles, 'vehicle')}, {plural(known.pedestrians, 'pedestrian')}"),
        ("hazards", hazard_text(known.hazards)),
        ("collisions", str(known.collisions)),
        ("recorded", decimal(known.file_bytes)),
    ]
    return f'<nav aria-label="Scenes">{"".join(links)}</nav>{facts(pairs)}'


def _screen(work: ScenePage, has_pictures: bool) -> str:
    """HTML of the video, or of the picture if there is to be none."""
    if not has_pictures:
        return ""
    name = escape(work.facts.name)
    picture = f'<img src="{SHEET}" alt="Sensors and labels of {name} in its middle frame">'
    if not work.video:
        return f'<div class="screen">{picture}</div>'
    label = f'aria-label="Sensors and labels of {name}, a video without sound"'
    return f'<div class="screen"><video controls preload="none" poster="{SHEET}" src="{VIDEO}" {label}></video></div>'


def _curves(known: SceneFacts, spec: SceneSpec, square: Square | None, *, has_plan: bool) -> str:
    """HTML of the map and of the curves over time."""
    time_s = known.moments["time_s"]
    labeled = known.moments[known.moments["labeled"]]
    counts = labeled["boxes"]
    classes = [k for k in range(len(BOX_CLASSES)) if counts[:, k].any()]
    boxes = [Series(words(BOX_CLASSES[k]), counts[:, k], class_color(BOX_CLASSES[k])) for k in classes]
    right = [figure("Boxes by class", curves(labeled["time_s"], boxes, "s", "boxes", over_time=True))] if boxes else []
    weather = _weather_curves(spec, known.duration_s)
    if square is None:
        return section("Over time", "".join(right) + weather)
    speed = [Series("ego", known.moments["speed_mps"])]
    right.insert(0, figure("Speed of the ego", curves(time_s, speed, "s", "m/s", over_time=True)))
    note = "Click a curve or the path to move the video." if has_plan else "The roads of this map could not be built."
    path = figure("Path of the ego", _map(known, spec, square, PLAN if has_plan else ""), note)
    sides = f'<div class="stack">{path}{weather}</div><div class="stack">{"".join(right)}</div>'
    return f'<div class="columns">{sides}</div>'


def _map(known: SceneFacts, spec: SceneSpec, square: Square, plan: str) -> Chart:
    """Chart of the ego's path, which starts at a ring, with the hazard areas, and a dot at the video's time."""
    data: list[dict[str, Any]] = []
    for hazard in spec.hazards:
        corners = [*hazard.outline_m, hazard.outline_m[0]]
        x, y = ([round(corner[k], 1) for corner in corners] for k in range(2))
        look = {"line": {"color": css(_HAZARD), "width": 2}, "showlegend": False, "hoverinfo": "name"}
        data.append({**_CLOSED, **look, "x": x, "y": y, "name": words(hazard.kind.value)})
    moments = known.moments[np.isfinite(known.moments["ego_m"]).all(axis=1)]
    x, y = (np.round(moments["ego_m"][:, k], 2).tolist() for k in range(2))
    ego = {"type": "scatter", "mode": "lines+markers", "name": "ego", "x": x, "y": y, "showlegend": False}
    values = {
        "customdata": np.round(moments["time_s"], 3).tolist(),
        "text": [f"{speed:.1f} m/s" for speed in moments["speed_mps"].tolist()],
        "hovertemplate": "%{customdata} s: %{text}<extra></extra>",
    }
    data.append(
        {**ego, **values, "line": {"color": css(_PATH), "width": 5}, "marker": {"color": css(_PATH), "size": 5}}
    )
    dot = {"color": "#ffffff", "size": 13, "line": {"color": css(_PATH), "width": 4}}
    data.append({**ego, "mode": "markers", "x": x[:1], "y": y[:1], "hoverinfo": "skip", "marker": dot})
    return Chart("Map", data, square.layout(_MAP_PX, plan), {"data-clock": "path", "data-path": str(len(data) - 2)})


def _weather_curves(spec: SceneSpec, duration_s: float) -> str:
    """The figure of the weather over time; empty if it does not change."""
    if spec.final_weather is None:
        return ""
    ends_s = np.array([0.0, duration_s])
    series = [
        Series(parameter_title(name), np.array(weather_ends(spec, name)), rgb_channels(parameter.curve))
        for name, parameter in WEATHER_PARAMETERS.items()
        if parameter.curve is not None
    ]
    return figure("Weather, % and °", curves(ends_s, series, "s", "", over_time=True))
