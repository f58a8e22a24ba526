"""The index of a dataset that scenes are being added to, written so seldom that the time for it grows with the scenes.

In: rows of finished scenes, one by one. Out: ``index.parquet``, after each of the first scenes and then whenever the
scenes have become a twentieth more. Rows that a crash has kept from being written are rebuilt from the bags.
"""

from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from simbev_ros.dataset.index import index_table, save_index, with_rows
from simbev_ros.dataset.index_row import Row
from simbev_ros.foundation.object_store.object_path import AnyPath

_GROWTH = 20
"""Inverse of the fraction of new rows at which the index is written."""


class GrowingIndex:
    """Keeps the rows of a dataset as a table, and writes it.

    Args:
        dataset: The dataset's folder.
        table: The rows so far, which are on the disk.
    """

    def __init__(self, dataset: AnyPath, table: pa.Table) -> None:
        self._dataset, self._table = dataset, table
        self._new: dict[int, tuple[Any, ...]] = {}
        self._bytes: dict[int, int] = dict(
            zip(*(table.column(name).to_pylist() for name in ("number", "bytes")), strict=True)
        )
        self.total_bytes = sum(self._bytes.values())
        """Size of all scenes."""
        self.largest_bytes = max(self._bytes.values(), default=0)
        """Size of the largest scene that there is or was."""

    def __contains__(self, number: int) -> bool:
        return number in self._bytes

    def __len__(self) -> int:
        return len(self._bytes)

    def add(self, row: Row) -> None:
        """Add the row of a scene, or replace the one with its number; the file follows at once or later.

        Raises:
            DiskError: The disk is full.
            InputError: The file cannot be written.
        """
        number, size = row["number"], row["bytes"]
        self.total_bytes += size - self._bytes.get(number, 0)
        self.largest_bytes = max(self.largest_bytes, size)
        self._new[number] = tuple(row[name] for name in self._table.column_names)  # rows take four times as much
        self._bytes[number] = size
        if len(self._new) * _GROWTH >= len(self):
            self.write()

    def remove(self, number: int) -> None:
        """Remove the row of a scene at once, if there is one.

        Raises:
            DiskError: The disk is full.
            InputError: The file cannot be written.
        """
        if number not in self:
            return
        self.write()
        table = self._table.filter(pc.not_equal(self._table["number"], number))
        save_index(self._dataset, table)
        self._table = table
        self.total_bytes -= self._bytes.pop(number)

    def write(self) -> None:
        """Write rows that are not on the disk yet.

        Raises:
            DiskError: The disk is full.
            InputError: The file cannot be written.
        """
        if not self._new:
            return
        rows = (dict(zip(self._table.column_names, values, strict=True)) for values in self._new.values())
        table = with_rows(self._table, index_table(rows))
        save_index(self._dataset, table)
        self._table = table
        self._new.clear()
