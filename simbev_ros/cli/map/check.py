"""The report of ``simbev map --check``: findings as a linter prints them, a table of rules, and a picture."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import typer
from rich import box
from rich.console import Console
from rich.table import Table

from simbev_ros.cli.console import make_console, table_console
from simbev_ros.cli.map.exploration import build_roads
from simbev_ros.drawing.canvas import Color, draw_text
from simbev_ros.foundation.types import UInt8Array
from simbev_ros.maps.findings import Finding, Outcome
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.show.maps.map_picture import bounding_square, write_picture
from simbev_ros.show.maps.map_plan import MapPlan

_MAX_LINES = 50
_SIDE_PX = 1400
_RADIUS_PX = 9
_COLORS: dict[Outcome, Color] = {
    Outcome.LEFT_OUT: (208, 42, 42),
    Outcome.REPAIRED: (230, 140, 20),
    Outcome.ASSUMED: (60, 110, 200),
}


def print_check(
    spec: MapSpec, max_loss_percent: float, out: Path | None, as_json: bool, cache_dir: Path, console: Console
) -> bool:
    """Build a map and print its findings; whether no more than a share of its driving lanes is lost.

    Args:
        spec: The map.
        max_loss_percent: The share.
        out: Where ``NAME-check.png`` is written; None: no picture.
        as_json: Print JSON instead of lines.
        cache_dir: The cache of maps.
        console: Shows the progress.

    Raises:
        InputError: The map cannot be read, or the picture cannot be written.
    """
    _, network = build_roads(spec, cache_dir, console)
    lost_percent = loss_percent(network)
    if as_json:
        typer.echo(json.dumps({"file": spec.path or None, **check_facts(network)}, indent=2))
    else:
        name, lines = Path(spec.path).name or spec.name, make_console(soft_wrap=True, highlight=False)
        for line in finding_lines(name, network.findings):
            lines.print(line)
        if network.findings:
            table_console().print(rules_table(network.findings))
        lines.print(f"{name}: {lost_percent:.2f} % of the driving lanes are lost; allowed: {max_loss_percent:g} %")
    if out is not None:
        write_picture(check_file(out), check_picture(network))
    return lost_percent <= max_loss_percent


def check_file(out: Path) -> Path:
    """File of the picture of a check."""
    return out.with_name(f"{out.stem}-check.png")


def loss_percent(network: RoadNetwork) -> float:
    """Share of the length of the file's driving lanes that the map lacks, in percent."""
    lost_m = sum(finding.lost_m for finding in network.findings)
    read_m = sum(lane.length_m for lane in network.lanes_of(LaneKind.DRIVING) if not lane.junction)
    return 100.0 * lost_m / (lost_m + read_m) if lost_m else 0.0


def finding_lines(name: str, findings: Sequence[Finding]) -> list[str]:
    """One line for each finding, as ``file:line: outcome: rule (detail)``; of many, the first ones and their number."""
    lines = [_line(name, finding) for finding in findings[:_MAX_LINES]]
    more = len(findings) - _MAX_LINES
    return [*lines, f"{name}: and {more:,} more, see --json"] if more > 0 else lines


def _line(name: str, finding: Finding) -> str:
    place = f"{name}:{finding.line}" if finding.line else name
    details = [finding.detail, f"{finding.count:,} times" if finding.count > 1 else ""]
    suffix = "; ".join(detail for detail in details if detail)
    return f"{place}: {finding.outcome}: {finding.rule}" + (f" ({suffix})" if suffix else "")


def rules_table(findings: Sequence[Finding]) -> Table:
    """A table with a row for each rule: outcome, count, and kilometers of driving lanes that are lost."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for title in ("outcome", "rule"):
        table.add_column(title, overflow="fold")
    for title in ("places", "lanes lost (km)"):
        table.add_column(title, justify="right")
    for rule in dict.fromkeys(finding.rule for finding in findings):
        group = [finding for finding in findings if finding.rule == rule]
        lost_km = sum(finding.lost_m for finding in group) / 1e3
        count = sum(finding.count for finding in group)
        table.add_row(str(group[0].outcome), rule, f"{count:,}", f"{lost_km:.2f}" if lost_km else "")
    return table


def check_facts(network: RoadNetwork) -> dict[str, Any]:
    """The report as data for JSON."""
    return {
        "loss_percent": round(loss_percent(network), 3),
        "findings": [
            {
                "outcome": str(finding.outcome),
                "rule": finding.rule,
                "line": finding.line or None,
                "detail": finding.detail,
                "count": finding.count,
                "position_m": None if finding.position_m is None else np.round(finding.position_m, 2).tolist(),
                "lost_m": round(finding.lost_m, 2),
            }
            for finding in network.findings
        ],
    }


def check_picture(network: RoadNetwork) -> UInt8Array:
    """(1400, 1400, 3) RGB plan of the map on which the place of each finding is marked with the line of the file."""
    placed = [(each, each.position_m) for each in network.findings if each.position_m is not None]
    center_m, side_m = bounding_square(network)
    reach_m = max([side_m / 2.0, *(float(np.abs(place_m - center_m).max()) * 1.05 for _, place_m in placed)])
    side_m = 2.0 * min(reach_m, 1.5 * side_m)  # places far off the map are marked at its border
    picture = MapPlan(network, center_m, side_m, _SIDE_PX).picture()
    for finding, place_m in placed:
        east_m, north_m = np.clip(place_m - center_m, -side_m / 2.0, side_m / 2.0)
        x, y = (round((0.5 + sign * offset_m / side_m) * _SIDE_PX) for sign, offset_m in ((1, east_m), (-1, north_m)))
        cv2.circle(picture, (x, y), _RADIUS_PX, _COLORS[finding.outcome], 3, cv2.LINE_AA)
        if finding.line:
            draw_text(picture, str(finding.line), x + _RADIUS_PX + 3, y - 4, size=15, color=_COLORS[finding.outcome])
    for row, (outcome, color) in enumerate(_COLORS.items()):
        cv2.circle(picture, (30, 34 + 28 * row), _RADIUS_PX, color, 3, cv2.LINE_AA)
        draw_text(picture, outcome.value, 48, 40 + 28 * row, size=17, color=color)
    return picture
