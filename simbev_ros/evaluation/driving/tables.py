"""Tables of drives as data: their scores, and their infractions and events by kind."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from simbev_ros.evaluation.driving.infractions import UNITS, InfractionKind
from simbev_ros.evaluation.driving.recorded_drives import RecordedDrive
from simbev_ros.evaluation.tables import Cell, CellKind, FigureTable
from simbev_ros.schema.scene.drive_spec import EventKind

_COLUMNS: Mapping[str, tuple[str, str, float]] = {
    "completed %": ("leaderboard_2_0", "route_completion", 1.0),
    "CARLA 2.0": ("leaderboard_2_0", "driving_score", 1.0),
    "CARLA 2.1": ("leaderboard_2_1", "driving_score", 1.0),
    "Bench2Drive": ("bench2drive", "driving_score", 1.0),
    "success %": ("bench2drive", "success", 100.0),
    "efficiency %": ("bench2drive", "efficiency", 1.0),
    "comfortness %": ("bench2drive", "comfortness", 1.0),
    "nuPlan": ("nuplan", "score", 100.0),
}
"""Score, figure and factor of each column."""


def drive_tables(drives: Sequence[RecordedDrive], means: Mapping[str, Any]) -> Iterator[FigureTable]:
    """Scores of each drive and their means, then the infractions and the events along the routes of all drives."""
    yield score_table({each.scene: each.figures for each in drives}, means)
    found = [infraction for drive in drives for infraction in drive.infractions]
    kinds = [kind for kind in InfractionKind if any(each.kind is kind for each in found)]
    if kinds:
        yield FigureTable(
            "infractions", ("kind", "count", "at fault", "drives"), [_counts(kind, drives) for kind in kinds]
        )
    types = Counter(each["type"] for drive in drives for each in drive.route_events)
    if events := [kind for kind in EventKind if types[f"{kind.value}.begin"]]:
        yield FigureTable("events", ("kind", "begun", "ended"), [_event_counts(kind, types) for kind in events])


def score_table(drives: Mapping[str, Mapping[str, Any]], means: Mapping[str, Any]) -> FigureTable:
    """Scores of drives by name, and their means if there are several."""
    rows = [_scores(name, figures) for name, figures in drives.items()]
    if len(drives) > 1:
        rows.append(_scores("mean", means))
    return FigureTable("drives", ("scene", *_COLUMNS, "ended"), rows)


def described(kind: InfractionKind, value: float) -> str:
    """Kind and value of an infraction in words."""
    name = kind.value.replace("_", " ")
    return f"{name}, {value:.3g} {UNITS[kind]}".rstrip()


def _scores(name: str, figures: Mapping[str, Any]) -> list[Cell]:
    values = [(figures["scores"][score].get(key), factor) for score, key, factor in _COLUMNS.values()]
    cells = [Cell(CellKind.NUMBER, None if value is None else factor * float(value)) for value, factor in values]
    return [Cell(CellKind.NAME, name), *cells, Cell(CellKind.NAME, str(figures.get("ended", "")) or "–")]


def _event_counts(kind: EventKind, types: Mapping[str, int]) -> list[Cell]:
    counts = (types[f"{kind.value}.{when}"] for when in ("begin", "end"))
    return [Cell(CellKind.NAME, kind.value), *(Cell(CellKind.COUNT, count) for count in counts)]


def _counts(kind: InfractionKind, drives: Sequence[RecordedDrive]) -> list[Cell]:
    of_drives = [[each for each in drive.infractions if each.kind is kind] for drive in drives]
    count, faults = sum(map(len, of_drives)), sum(each.at_fault for some in of_drives for each in some)
    cells = [Cell(CellKind.COUNT, number) for number in (count, faults, sum(map(bool, of_drives)))]
    return [Cell(CellKind.NAME, kind.value), *cells]
