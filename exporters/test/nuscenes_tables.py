"""Exports datasets to nuScenes' layout in tests, and reads the tables."""

import hashlib
import json
from pathlib import Path
from typing import Any

from simbev_exporters.nuscenes.export import Exported, ExportSettings, export_nuscenes
from simbev_ros.dataset import open_dataset

Tables = dict[str, list[dict[str, Any]]]
TABLES = ["category", "attribute", "visibility", "instance", "sensor", "calibrated_sensor", "ego_pose", "log", "scene"]
TABLES += ["sample", "sample_data", "sample_annotation", "map"]


def export(dataset: Path, out: Path, **settings: Any) -> Exported:
    return export_nuscenes(open_dataset(dataset, threads=1), out, ExportSettings(**settings))


def tables_of(out: Path) -> Tables:
    return {name: json.loads((out / "v1.0-trainval" / f"{name}.json").read_text()) for name in TABLES}


def digest(out: Path) -> dict[str, str]:
    files = [path for path in out.rglob("*") if path.is_file() and path.name != ".lock"]
    return {str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
