"""Indexes of datasets that tests write by hand."""

from collections.abc import Iterable
from pathlib import Path

from simbev_ros.dataset.index import index_table, save_index
from simbev_ros.dataset.index_row import Row


def write_index(dataset: Path, rows: Iterable[Row]) -> None:
    """Write an index with these rows."""
    save_index(dataset, index_table(rows))
