"""Figures of a dataset's page about its scenes: counts by map, traffic and weather.

A dataset's ``Statistics`` enter; HTML figures with charts leave.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from rich.filesize import decimal

from simbev_ros.config.scenario import SPLITS
from simbev_ros.config.weather import WEATHER_PARAMETERS
from simbev_ros.dataset.statistics import SceneFacts, Statistics
from simbev_ros.dataset.tallies import SPEED_STEP_MPS
from simbev_ros.foundation.types import AnyArray
from simbev_ros.show.pages.charts import SMALL_PX, Series, bars, figure, histogram
from simbev_ros.show.reports.svg_drawing import Color, number

SPLIT_COLORS: dict[str, Color] = {"train": (47, 111, 143), "val": (217, 142, 50), "test": (166, 68, 92)}
_MAX_KINDS = 20
_COLUMNS = 24
_WEATHER_BINS = 20


def key_figures(statistics: Statistics) -> list[tuple[str, str]]:
    """Key numbers for the head of the page, each with its label."""
    scenes, tally = statistics.scenes, statistics.tally
    frames = sum(scene.frames for scene in scenes)
    minutes = sum(scene.duration_s for scene in scenes) / 60.0
    return [
        (number(len(scenes)), "scenes"),
        (number(len({scene.map for scene in scenes})), "maps"),
        (number(frames), "frames"),
        (number(round(minutes, 1)), "minutes"),
        (number(round(sum(scene.distance_m for scene in scenes) / 1000.0, 2)), "km driven"),
        (number(round(int(tally.counts["boxes"].sum()) / max(tally.labeled_frames, 1), 1)), "boxes a frame"),
        (decimal(sum(scene.file_bytes for scene in scenes)), "recorded"),
    ]


def scene_figures(statistics: Statistics) -> Iterator[str]:
    """Figures of scenes by map and split, of the number of actors, of the ego's speed and of the kinds of actors."""
    scenes = statistics.scenes
    maps = sorted({scene.map for scene in scenes})
    counts = {split: [sum(s.map == name and s.split == split for s in scenes) for name in maps] for split in SPLITS}
    series = [Series(split, np.array(counts[split]), SPLIT_COLORS[split]) for split in SPLITS]
    yield figure("Scenes by map", bars(maps, [each for each in series if each.values.any()]))
    for name, title in (("vehicles", "Vehicles in a scene"), ("pedestrians", "Pedestrians in a scene")):
        values = np.array([getattr(scene, name) for scene in scenes])
        step = max(1, int(np.ceil((values.max() + 1) / _COLUMNS)))
        yield figure(title, histogram(_by_split(scenes, values, 0.0, step), step, name, "scenes"))
    speeds = statistics.tally.counts["ego_speed"]
    yield figure("Speed of the ego", histogram([Series("frames", speeds)], SPEED_STEP_MPS, "m/s", "frames"))
    kinds = statistics.tally.actors.most_common(_MAX_KINDS)
    drawn = Series("actors", np.array([count for _, count in kinds]))
    yield figure(
        "Most frequent actors", bars([name for name, _ in kinds], [drawn]), "In the first frames of all scenes."
    )


def weather_figures(statistics: Statistics) -> Iterator[str]:
    """Figures of the distribution of each weather parameter over the scenes."""
    for name, parameter in WEATHER_PARAMETERS.items():
        (low, high), unit = parameter.axis, parameter.unit
        values = np.array([getattr(scene.weather, name) for scene in statistics.scenes])
        step = (high - low) / _WEATHER_BINS
        inside = np.clip(values, low, high - step / 2)
        yield figure(
            parameter_title(name),
            histogram(
                _by_split(statistics.scenes, inside, low, step), step, unit, "scenes", low, SMALL_PX, _WEATHER_BINS
            ),
        )


def parameter_title(name: str) -> str:
    """Name of a parameter of the weather as a title, without its unit."""
    return name.removesuffix("_deg").removesuffix("_m").replace("_", " ").capitalize()


def _by_split(scenes: Sequence[SceneFacts], values: AnyArray, low: float, step: float) -> list[Series]:
    """Number of scenes of each split whose values are in each bin of width ``step``, starting at ``low``."""
    bin_index = np.maximum(np.floor((values - low) / step).astype(int), 0)
    found = []
    for split, color in SPLIT_COLORS.items():
        rows = [scene.split == split for scene in scenes]
        found.append(Series(split, np.bincount(bin_index[rows], minlength=int(bin_index.max()) + 1), color))
    return found
