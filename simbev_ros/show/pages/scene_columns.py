"""The columns about a scene's conditions that the dataset's table and the sheet of drawn scenes share."""

from collections.abc import Mapping

from simbev_ros.evaluation.conditions import daytime_of, weather_of
from simbev_ros.foundation.counts import plural
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.show.pages.browsable_table import Cell, Column
from simbev_ros.show.reports.page import words

CONDITIONS = (
    Column("light", "choice", "time of day at the start, by the sun's altitude"),
    Column("weather", "choice", "weather at the start"),
    Column("sun °", None, "altitude of the sun at the start", is_number=True),
)


def condition_cells(weather: Weather, final: Weather | None = None) -> list[Cell]:
    """Cells of ``CONDITIONS`` for a scene's weather at its start; with its ``final`` one, they show what changes."""
    light, sky = daytime_of(weather), weather_of(weather)
    if final is None:
        return [Cell(light), Cell(sky), Cell(round(weather.sun_altitude_deg))]
    changes = _change(light, daytime_of(final)), _change(sky, weather_of(final))
    sun = _change(*(f"{each.sun_altitude_deg:.0f}" for each in (weather, final)))
    return [Cell(light, changes[0]), Cell(sky, changes[1]), Cell(round(weather.sun_altitude_deg), sun)]


def hazard_cell(hazards: Mapping[str, int]) -> Cell:
    """Cell with the number of hazard areas by kind, by which scenes are chosen."""
    return Cell(" ".join(sorted(hazards)) or "none", hazard_text(hazards) if hazards else "–")


def hazard_text(hazards: Mapping[str, int]) -> str:
    """The number of hazard areas by kind in words."""
    counts = (plural(count, words(kind)) for kind, count in sorted(hazards.items()))
    return ", ".join(counts) or "no hazards"


def _change(start: str, end: str) -> str:
    return start if start == end else f"{start} → {end}"
