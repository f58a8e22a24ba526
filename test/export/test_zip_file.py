"""ZIP files of one file, read by Python's own module."""

import io
import zipfile

import numpy as np
import pytest

from simbev_ros.export.simbev import zip_file
from simbev_ros.export.simbev.zip_file import zip_of_one_file


@pytest.mark.parametrize("content", [b"", b"a", bytes(1 << 20), np.random.default_rng(0).bytes(100_000)])
def test_it_holds_the_file(content: bytes) -> None:
    data = zip_of_one_file("data.npy", content)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert archive.testzip() is None
        [entry] = archive.infolist()
        assert (entry.filename, entry.file_size) == ("data.npy", len(content))
        assert entry.compress_type == zipfile.ZIP_DEFLATED
        assert entry.date_time == (1980, 1, 1, 0, 0, 0)
        assert archive.read("data.npy") == content
    assert zip_of_one_file("data.npy", content) == data


def test_what_zip_files_cannot_hold_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zip_file, "_MAX_BYTES", 10)
    with pytest.raises(ValueError, match="a has 11 bytes; at most 10 fit"):
        zip_of_one_file("a", bytes(11))
