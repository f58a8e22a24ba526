"""The index of a dataset in an object store that scenes are being added to.

In an object store the index makes a scene exist, and it cannot be rebuilt from the bags without reading them. So each
row that a ``GrowingIndex`` does not write at once is a separate object, ``.rows/<number>.parquet``, until it does.
"""

import pyarrow as pa

from simbev_ros.dataset.growing_index import GrowingIndex
from simbev_ros.dataset.index import index_table, load_index, packed_rows, read_rows, save_index, with_rows
from simbev_ros.dataset.index_row import Row
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import delete_tree, list_objects, put_bytes
from simbev_ros.recording.layout import INDEX_FILE

_ROWS_FOLDER = ".rows"
_MAX_ROW_BYTES = 1 << 20


def load_stored_index(dataset: ObjectPath) -> pa.Table:
    """The index of a dataset with the rows that a killed driver has not added to it.

    Raises:
        InputError: The index or such a row is damaged, or the store cannot be reached or refuses access.
    """
    table = load_index(dataset)
    rows = [read_rows(path, pa.BufferReader(path.read_bytes(_MAX_ROW_BYTES))) for path in _row_objects(dataset)]
    return with_rows(table, pa.concat_tables(rows)).sort_by("number") if rows else table


class StoredIndex(GrowingIndex):
    """Keeps the rows of a dataset, and writes them into the store. The caller holds the dataset's lock.

    Args:
        dataset: The dataset; it has an index from now on, with the rows that a killed driver has left.

    Raises:
        InputError: The index or a row is damaged (here only), or the store cannot be reached or refuses access.
    """

    def __init__(self, dataset: ObjectPath) -> None:
        self._rows = dataset / _ROWS_FOLDER
        table, self._has_rows = load_stored_index(dataset), bool(_row_objects(dataset))
        super().__init__(dataset, table)
        if self._has_rows or not (dataset / INDEX_FILE).is_file():
            save_index(dataset, table)
            self._delete_rows()

    def sizes(self) -> dict[str, int]:
        """Size in bytes of the MCAP files of each scene in the index, by the path of its bag in the dataset."""
        return dict(zip(*(self._table.column(name).to_pylist() for name in ("path", "bytes")), strict=True))

    def add(self, row: Row) -> None:
        """Add the row of a scene, or replace the one with its number; a crash does not lose it."""
        super().add(row)
        if self._new:
            self._has_rows = True
            put_bytes(packed_rows(index_table([row])), self._rows / f"{row['number']}.parquet")

    def write(self) -> None:
        """Write rows that are not in the index yet."""
        super().write()
        self._delete_rows()

    def _delete_rows(self) -> None:
        if self._has_rows:
            delete_tree(self._rows)
            self._has_rows = False


def _row_objects(dataset: ObjectPath) -> list[ObjectPath]:
    return list(list_objects(dataset / _ROWS_FOLDER))
