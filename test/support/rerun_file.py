"""Reads a file of Rerun with Rerun's own reader."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader


@dataclass(frozen=True)
class Row:
    """Components that were logged for an entity at a time.

    Attributes:
        tick: Number of the tick; None if the row is static.
        time_ns: Time on the viewer's time line; None if the row is static.
        values: Components by name, such as ``Transform3D:translation``.
    """

    tick: int | None
    time_ns: int | None
    values: dict[str, Any]


def rows_by_entity(file: Path) -> dict[str, list[Row]]:
    """The rows of a file's only recording by entity, in the order of their times."""
    (recording,) = RrdReader(file).recordings()
    assert recording.application_id == "simbev_ros"
    found: dict[str, list[Row]] = {}
    for chunk in RrdReader(file).stream().to_chunks():
        found.setdefault(str(chunk.entity_path).strip("/"), []).extend(_rows(chunk))
    return {
        entity: sorted(rows, key=lambda row: -1 if row.tick is None else row.tick) for entity, rows in found.items()
    }


def _rows(chunk: Any) -> Iterator[Row]:
    batch = chunk.to_record_batch()
    names = batch.schema.names
    for index in range(batch.num_rows):
        values = {name: batch.column(name)[index].as_py() for name in names if ":" in name}
        if chunk.is_static:
            yield Row(None, None, values)
        else:
            yield Row(batch.column("tick")[index].as_py(), batch.column("time")[index].value, values)
