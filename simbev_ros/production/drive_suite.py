"""The suite of drives: a table of scenes by ability, made like any dataset, and the scores of a driver on it.

``drive_suite.yaml`` is the table. The scenes of an ability are a dataset of their own. Scene k of an ability is the
same however many are asked for, and its name is unique in the suite.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

import yaml

from simbev_ros.config.included_stacks import DRIVER_INTERFACE, INCLUDED_DRIVERS
from simbev_ros.config.load import parse_scenario
from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset import Scene, open_dataset
from simbev_ros.evaluation.conditions import daytime_of, weather_of
from simbev_ros.evaluation.driving.figures import drives_figures, mean_figures
from simbev_ros.evaluation.driving.recorded_drives import RecordedDrive, drives_of
from simbev_ros.evaluation.driving.tables import score_table
from simbev_ros.evaluation.tables import FigureTable
from simbev_ros.foundation.errors import InputError
from simbev_ros.production.dataset import DatasetResult, changed_sections, check_workers, make_dataset
from simbev_ros.production.observer import SILENT, ProductionObserver

GROUPS = ("ability", "town", "weather", "daytime")
"""What the scores of a suite are grouped by."""
_OWN_DRIVERS = {"traffic": "traffic", "none": "twist"}
"""``ego.driver`` of suites without a driver outside: our traffic drives, or nobody does."""


@cache
def _table() -> dict[str, Any]:
    table: dict[str, Any] = yaml.safe_load(Path(__file__).with_name("drive_suite.yaml").read_text(encoding="utf-8"))
    return table


def suite_size() -> int:
    """Number of routes of the whole suite."""
    return int(_table()["scenes"]) * len(_table()["abilities"])


def suite_scenarios(stack: str, interface: str, routes: int) -> dict[str, Scenario]:
    """Configuration of the scenes of each ability that has any.

    Args:
        stack: Name of an included driver, ``traffic``, ``none``, or a command.
        interface: ``ego.driver`` for a command.
        routes: Number of routes, which are distributed evenly among abilities and towns.

    Raises:
        InputError: The command is empty.
    """
    table, abilities = _table(), _table()["abilities"]
    towns, scenarios = table["towns"], {}
    driver = _OWN_DRIVERS.get(stack, DRIVER_INTERFACE if stack in INCLUDED_DRIVERS else interface)
    own: dict[str, Any] = _merged(table["drivers"].get(stack, {}), {"ego": {"driver": driver}})
    if stack not in _OWN_DRIVERS:
        own["drive"] = {"stack": stack}
    for index, (ability, changes) in enumerate(abilities.items()):
        count = routes // len(abilities) + (index < routes % len(abilities))
        scenes = [{"map": towns[(scene + index) % len(towns)], "test": 1} for scene in range(count)]
        if scenes:
            values = _merged(_merged(_merged(table["scenario"], changes), own), {"scenes": scenes})
            scenarios[ability] = parse_scenario(yaml.safe_dump(values), f"--stack {stack!r}")
    return scenarios


def _merged(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A nested mapping with changes to its leaves."""
    merged = dict(values)
    for key, value in changes.items():
        inner = merged.get(key)
        merged[key] = _merged(inner, value) if isinstance(inner, Mapping) and isinstance(value, Mapping) else value
    return merged


def make_suite(
    scenarios: Mapping[str, Scenario],
    out: Path,
    *,
    workers: int | Literal["auto"] | None = None,
    ray: str | None = None,
    observers: Mapping[str, ProductionObserver] | None = None,
) -> dict[str, DatasetResult]:
    """Make the scenes of each ability in the folder ``out/ability``; existing scenes are kept.

    Args:
        scenarios: The abilities, from ``suite_scenarios``.
        out: The folder.
        workers: Number of graphs side by side, as in ``make_dataset``.
        ray: A Ray cluster, as in ``make_dataset``.
        observers: Who is told of each ability's progress.

    Raises:
        InputError: The folder has drives of another driver, or as ``make_dataset``.
        DiskError: The disk is full, or nearly.
    """
    check_workers(workers, ray)
    for ability, scenario in scenarios.items():
        if changed := changed_sections(scenario, out / ability):
            raise InputError(
                f"{out / ability}: has drives with other settings ({', '.join(changed)}); use a new folder"
            )
    return {
        ability: make_dataset(
            scenario, out / ability, workers=workers, ray=ray, observer=(observers or {}).get(ability, SILENT)
        )
        for ability, scenario in scenarios.items()
    }


@dataclass(frozen=True, slots=True)
class SuiteDrive:
    """A drive of a suite: its scene, what was judged, and the groups of ``GROUPS`` to which it belongs."""

    scene: Scene
    drive: RecordedDrive
    groups: Mapping[str, str]


def suite_drives(scenarios: Mapping[str, Scenario], out: Path) -> list[SuiteDrive]:
    """The drives of a suite that exist.

    Raises:
        BagError: A bag is damaged.
    """
    found = []
    for ability in scenarios:
        scenes = open_dataset(out / ability, threads=1).scenes
        for scene, drive in zip(scenes, drives_of(scenes), strict=True):
            weather = scene.spec.weather
            values = (ability, scene.spec.map.name, weather_of(weather), daytime_of(weather))
            found.append(SuiteDrive(scene, drive, dict(zip(GROUPS, values, strict=True))))
    return found


def suite_figures(drives: Sequence[SuiteDrive], stack: str) -> dict[str, Any]:
    """Means of all drives and of each group, and the figures of each scene, as plain values for JSON."""
    scenes = {each.scene.name: {**each.groups, **each.drive.record()} for each in drives}
    by = {
        group: {name: mean_figures([each.drive.figures for each in some]) for name, some in _grouped(drives, group)}
        for group in GROUPS
    }
    return {"stack": stack, **drives_figures(scenes), "by": by}


def suite_tables(figures: Mapping[str, Any]) -> Iterator[FigureTable]:
    """Tables of the scores by group, from the values of ``suite_figures``."""
    for group in GROUPS:
        table = score_table(
            {f"{name} ({each['drives']})": each for name, each in figures["by"][group].items()}, figures
        )
        yield FigureTable(f"by {group}", (group, *table.heads[1:-1]), [row[:-1] for row in table.rows])


def _grouped(drives: Sequence[SuiteDrive], group: str) -> Iterator[tuple[str, list[SuiteDrive]]]:
    groups: defaultdict[str, list[SuiteDrive]] = defaultdict(list)
    for each in drives:
        groups[each.groups[group]].append(each)
    yield from sorted(groups.items()) if group == "town" else groups.items()
