"""Writes the thirteen tables of a nuScenes export from the parts of its scenes, and the lists of splits.

The last stage of an export: finished parts and the sites of their maps enter; the folder of JSON tables leaves.
"""

import json
import shutil
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TextIO

from simbev_exporters.nuscenes.evaluated_classes import evaluated_classes
from simbev_exporters.nuscenes.scene_part import ScenePart
from simbev_exporters.nuscenes.sites import Site
from simbev_exporters.nuscenes.taxonomy import Record, taxonomy_tables
from simbev_ros.config.scenario import SPLITS
from simbev_ros.foundation.errors import FOREIGN_ERRORS, foreign_content
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.files.syncing import sync
from simbev_ros.foundation.files.whole_files import write_errors
from simbev_ros.schema.nuscenes import detection_ranges_m

_SCENE_TABLES = (
    "scene",
    "log",
    "sample",
    "sample_data",
    "ego_pose",
    "calibrated_sensor",
    "sample_annotation",
    "instance",
)
_DECIMALS = 9


def write_tables(
    out: Path,
    parts: Sequence[ScenePart],
    sites: Sequence[Site],
    version: str,
    names: Mapping[str, str],
    labels: Sequence[Record],
) -> dict[str, tuple[str, ...]]:
    """Write the folder of tables and replace an earlier one with it.

    Args:
        out: Folder of the export.
        parts: The finished parts of the scenes.
        sites: The sites of all these scenes.
        version: Name of the folder.
        names: Name of each scene in the tables, by its own name.
        labels: Rows of the table ``lidarseg``; without any, the table is missing.

    Returns:
        Classes of the detection task that occur, in its order, by name of the split.
    """
    folder = out / version
    unfinished, old = (out / f".{version}{suffix}" for suffix in (".part", ".old"))
    for leftover in (unfinished, old):
        shutil.rmtree(leftover, ignore_errors=True)
    unfinished.mkdir()
    classes = _write(parts, sites, unfinished, names, labels)
    sync(*unfinished.iterdir(), unfinished)
    if folder.exists():
        folder.rename(old)
    unfinished.rename(folder)
    sync(out)
    shutil.rmtree(old, ignore_errors=True)
    _remove_masks(out)
    return {split: tuple(name for name in detection_ranges_m() if name in found) for split, found in classes.items()}


def _write(
    parts: Sequence[ScenePart], sites: Sequence[Site], folder: Path, names: Mapping[str, str], labels: Sequence[Record]
) -> dict[str, set[str]]:
    """Write the tables; return the classes of the detection task that occur, by name of the split."""
    site_of = {name: site for site in sites for name in site.scenes}
    logs: defaultdict[str, list[str]] = defaultdict(list)
    sensors: dict[str, Record] = {}
    splits: dict[str, list[str]] = {f"simbev_{split}": [] for split in SPLITS}
    classes: defaultdict[str, set[str]] = defaultdict(set)
    with ExitStack() as stack:
        files = {name: stack.enter_context(_Table(folder / f"{name}.json")) for name in _SCENE_TABLES}
        for part in parts:
            with foreign_content(part.out / part.rows_file), write_errors(folder):
                site, summary, rows = site_of[part.scene.name], part.summary(), part.rows()
                rows["scene"] = [{**record, "name": names[record["name"]]} for record in rows["scene"]]
                for name, file in files.items():
                    file.add(_CONVERSIONS[name](rows[name], site) if name in _CONVERSIONS else rows[name])
                logs[site.token] += [record["token"] for record in rows["log"]]
                sensors.update({record["token"]: record for record in summary["sensors"]})
                split = f"simbev_{summary['split']}"
                splits[split].append(names[part.scene.name])
                classes[split] |= evaluated_classes(rows)
    rest = {**taxonomy_tables(lidarseg=bool(labels)), "sensor": list(sensors.values())}
    if labels:
        rest["lidarseg"] = list(labels)
    rest["map"] = [site.record(logs[site.token]) for site in sites if logs[site.token]]
    for name, records in rest.items():
        with _Table(folder / f"{name}.json") as table:
            table.add(records)
    (folder / "splits.json").write_text(json.dumps(splits, indent=1), encoding="utf-8")
    return classes


def _remove_masks(out: Path) -> None:
    """Remove the masks that no table of maps names; none if a table, of another version, cannot be read."""
    try:
        kept = {record["filename"] for table in out.glob("*/map.json") for record in parse_json(table.read_bytes())}
    except FOREIGN_ERRORS:
        return
    for mask in (out / "maps").glob("*.png"):
        if str(mask.relative_to(out)) not in kept:
            mask.unlink()


def _relative_to_site(records: Iterable[Record], site: Site) -> Iterator[Record]:
    """Records with their positions in nuScenes' global frame instead of the map frame."""
    for record in records:
        x_m, y_m, z_m = record["translation"]
        position_m = [
            round(x_m - site.low_m[0], _DECIMALS),
            round(y_m - site.low_m[1], _DECIMALS),
            round(z_m, _DECIMALS),
        ]
        yield {**record, "translation": position_m}


def _with_location(records: Iterable[Record], site: Site) -> Iterator[Record]:
    """Records with the name of their site as location."""
    return ({**record, "location": site.name} for record in records)


_CONVERSIONS = {"ego_pose": _relative_to_site, "sample_annotation": _relative_to_site, "log": _with_location}
"""Conversions of the tables whose rows depend on the site of their scene, by name of the table."""


class _Table:
    """A JSON list in a file that is written record by record, one on each line."""

    def __init__(self, path: Path) -> None:
        self._file: TextIO = path.open("w", encoding="utf-8")
        self._separator = "[\n"

    def add(self, records: Iterable[Record]) -> None:
        """Append records."""
        for record in records:
            self._file.write(self._separator + json.dumps(record))
            self._separator = ",\n"

    def __enter__(self) -> "_Table":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.write("\n]" if self._separator != "[\n" else "[]")
        self._file.close()
