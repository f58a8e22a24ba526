"""The columns about a scene's conditions that the dataset's table and the sheet of drawn scenes share."""

from collections.abc import Mapping

from simbev_ros.evaluation.conditions import daytime_of, weather_of
from simbev_ros.scene.weather import Weather
from simbev_ros.viz.pages.browsable_table import Cell, Column

CONDITIONS = (
    Column("light", "choice", "time of day at the start, by the sun's altitude"),
    Column("weather", "choice", "weather at the start"),
    Column("sun °", None, "altitude of the sun at the start", is_number=True),
)


def condition_cells(weather: Weather) -> list[Cell]:
    """Cells of ``CONDITIONS`` for a scene's weather at its start."""
    return [Cell(daytime_of(weather)), Cell(weather_of(weather)), Cell(round(weather.sun_altitude_deg))]


def hazard_cell(hazards: Mapping[str, int]) -> Cell:
    """Cell with the number of hazard areas by kind, by which scenes are chosen."""
    shown = ", ".join(f"{count} {kind.replace('_', ' ')}" for kind, count in sorted(hazards.items()) if count)
    return Cell(" ".join(sorted(hazards)) or "none", shown or "–")
