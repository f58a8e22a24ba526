"""The report of ``simbev map`` on a map, as JSON and as tables."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.maps.statistics import MapStatistics
from simbev_ros.schema.scene.map_spec import MapSpec


@dataclass(frozen=True, slots=True)
class Surroundings:
    """The static scene around one position, or of the whole map.

    Attributes:
        seconds: Time to build or load it.
        triangles: Number of triangles of its meshes.
        regions: Number of its regions.
        of_regions: Number of regions of the map.
    """

    seconds: float
    triangles: int
    regions: int
    of_regions: int


@dataclass(frozen=True, slots=True)
class MapReport:
    """Facts of a map.

    Attributes:
        spec: The map.
        statistics: Numbers and lengths of its parts.
        datum: Geographic position of its origin.
        notes: Repairs and omissions.
        network_s: Time to build or load the roads.
        surroundings: The static scene; None if it was not asked for.
    """

    spec: MapSpec
    statistics: MapStatistics
    datum: MapDatum
    notes: tuple[str, ...]
    network_s: float
    surroundings: Surroundings | None = None

    def facts(self) -> dict[str, Any]:
        """The report as data for JSON."""
        return {
            "name": self.spec.name,
            "file": self.spec.path or None,
            "bounds": self.spec.bounds,
            "seed": self.spec.seed,
            "datum": asdict(self.datum),
            **asdict(self.statistics),
            "network_s": round(self.network_s, 2),
            "surroundings": None if self.surroundings is None else asdict(self.surroundings),
            "notes": list(self.notes),
        }


def map_table(report: MapReport) -> Table:
    """A table of one map with a line for each fact."""
    figures = report.statistics
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    table.add_row("map", Text.assemble((report.spec.name, "bold"), f", seed {report.spec.seed}"))
    if report.spec.path:
        table.add_row("file", report.spec.path)
    if report.spec.bounds is not None:
        table.add_row("bounds", ",".join(f"{value:g}" for value in report.spec.bounds))
    table.add_row("origin", f"{report.datum.latitude_deg:.6f}°, {report.datum.longitude_deg:.6f}°")
    table.add_row("size", f"{figures.width_m:.0f} × {figures.depth_m:.0f} m")
    lanes = ", ".join(f"{kind.replace('_', ' ')} {length_km:.1f} km" for kind, length_km in figures.lane_km.items())
    table.add_row("lanes", lanes)
    table.add_row("junctions", f"{figures.junctions}")
    table.add_row("signals", f"{figures.signals} heads")
    table.add_row("signs", f"{figures.signs}")
    table.add_row("crosswalks", f"{figures.crosswalks}")
    table.add_row("heights", f"{figures.lowest_m:.1f} to {figures.highest_m:.1f} m")
    table.add_row("two-level crossings", f"{figures.two_level_crossings}")
    table.add_row("zones, waters", f"{figures.zones}, {figures.water_areas}")
    invented = figures.prescribed_buildings is None
    table.add_row("buildings", "invented" if invented else f"{figures.prescribed_buildings}, as in the file")
    table.add_row("roads", f"ready after {report.network_s:.1f} s")
    if (built := report.surroundings) is not None:
        where = "" if built.regions == built.of_regions else f" of {built.regions} of {built.of_regions} regions"
        table.add_row("surroundings", f"{built.triangles:,} triangles{where}, ready after {built.seconds:.1f} s")
    for note in report.notes:
        table.add_row("note", Text(note, "dim"))
    return table


def towns_table(reports: Sequence[MapReport]) -> Table:
    """A table of several maps with a line for each."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("map")
    for title in (
        "size (m)",
        "driving (km)",
        "other lanes (km)",
        "junctions",
        "signals",
        "signs",
        "crosswalks",
        "heights (m)",
        "two levels",
        "roads ready",
    ):
        table.add_column(title, justify="right", no_wrap=True)
    for report in reports:
        figures = report.statistics
        driving_km = figures.lane_km.get("driving", 0.0)
        table.add_row(
            report.spec.name,
            f"{figures.width_m:.0f} × {figures.depth_m:.0f}",
            f"{driving_km:.1f}",
            f"{sum(figures.lane_km.values()) - driving_km:.1f}",
            f"{figures.junctions}",
            f"{figures.signals}",
            f"{figures.signs}",
            f"{figures.crosswalks}",
            f"{figures.lowest_m:.0f} to {figures.highest_m:.0f}",
            f"{figures.two_level_crossings}",
            f"{report.network_s:.1f} s",
        )
    return table
