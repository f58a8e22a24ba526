"""Bzip2 and NPZ data that claim or unpack to too much are refused before they take memory."""

import bz2
import gzip
import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import zstandard
from peak_memory import MIB, at_most

from simbev_ros.foundation.errors import InputError, LimitError
from simbev_ros.foundation.files.limits import MAX_UNPACKED_VARIABLE
from simbev_ros.foundation.files.unpacking import NpzReader, bunzip2, read_npy, read_unpacked


def test_bzip2_data_are_unpacked_up_to_the_limit() -> None:
    data = bz2.compress(bytes(MIB)) * 2  # two members
    assert bunzip2(data, 2 * MIB) == bytes(2 * MIB)
    with pytest.raises(LimitError, match="more than 1 MiB"):
        bunzip2(data, MIB)


def test_a_bzip2_bomb_takes_no_memory() -> None:
    bomb = bz2.compress(bytes(64 * MIB))
    with at_most(8), pytest.raises(LimitError):
        bunzip2(bomb, 2 * MIB)


def npz(members: dict[str, bytes], compression: int = zipfile.ZIP_DEFLATED) -> io.BytesIO:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", compression) as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.npy", data)
    file.seek(0)
    return file


def npy(shape: str, dtype: str, data: bytes) -> bytes:
    header = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}}}".ljust(117) + "\n"
    return b"\x93NUMPY\1\0" + len(header).to_bytes(2, "little") + header.encode() + data


def zeros(mib: int) -> bytes:
    return npy(f"({mib * MIB},)", "|u1", bytes(mib * MIB))


def test_arrays_are_those_of_numpy() -> None:
    file = io.BytesIO()
    np.savez_compressed(file, a=np.arange(6).reshape(2, 3), b=np.array("text"), c=np.zeros((0, 3)))
    reader = NpzReader(file)
    assert reader.names == ("a", "b", "c")
    assert reader["a"].tolist() == [[0, 1, 2], [3, 4, 5]] and reader["b"] == "text" and reader["c"].shape == (0, 3)
    assert NpzReader(file, ["a"]).names == ("a",)


def test_the_limit_is_for_all_wanted_arrays_together(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(MAX_UNPACKED_VARIABLE, "4")
    file = npz({"a": zeros(3), "b": zeros(3)})
    with at_most(2), pytest.raises(LimitError, match=r"unpacks to 7 MiB; at most 4 MiB"):
        NpzReader(file)
    assert len(NpzReader(file, ["a"])["a"]) == 3 * MIB


@pytest.mark.parametrize(
    "make",
    [
        lambda: npz({"a": npy(f"({1 << 30},)", "<f8", bytes(8))}),
        lambda: npz({"a": npy(f"({1 << 60},)", "<U0", b"")}),
        lambda: npz({"a": zeros(32)}, zipfile.ZIP_LZMA),
        lambda: npz({"a": zeros(32)}, zipfile.ZIP_BZIP2),
        lambda: npz({"a": b"\x93NUMPY\3\0" + zeros(1)[8:]}),
    ],
    ids=["count", "empty texts", "lzma", "bzip2", "version 3"],
)
def test_an_array_that_promises_more_than_it_holds_is_refused(make: Callable[[], io.BytesIO]) -> None:
    reader = NpzReader(make())
    with at_most(2), pytest.raises(ValueError, match=r"its header says|another way than by numpy|is not supported"):
        reader["a"]


def test_the_content_of_an_npy_file_is_checked_before_it_is_read() -> None:
    assert read_npy(npy("(2,)", "<u4", bytes([1, 0, 0, 0, 2, 0, 0, 0]))).tolist() == [1, 2]
    with at_most(2), pytest.raises(ValueError, match="its header says"):
        read_npy(npy(f"({1 << 30},)", "<f8", bytes(8)))


def test_structured_arrays_have_plain_values() -> None:
    rows = np.array([(1, 2.5)], [("a", "<i4"), ("b", "<f8")])
    good = io.BytesIO()
    np.save(good, rows)
    assert read_npy(good.getvalue())["b"].tolist() == [2.5]
    nested = io.BytesIO()
    np.save(nested, np.zeros(1, [("a", "<f4", (2,))]))  # sizes of large ones overflow in numpy
    with pytest.raises(ValueError, match="its fields are not plain values"):
        read_npy(nested.getvalue())


@pytest.mark.parametrize("number", [0x110000, 0xFFFFFFFF, 0xD800, 0xDFFF])
@pytest.mark.parametrize("order", "<>")
def test_texts_with_numbers_that_are_not_characters_are_refused(number: int, order: str) -> None:
    for last, is_text in ((ord("€"), True), (number, False)):
        stream = io.BytesIO()
        np.savez(stream, names=np.array([[65, last]], f"{order}u4").view(f"{order}U2"))
        if is_text:
            assert NpzReader(stream)["names"].item() == "A€"
        else:
            with pytest.raises(ValueError, match="not characters"):
                NpzReader(stream)["names"]


def test_an_array_of_python_2_is_read_without_a_warning() -> None:
    plain, file = io.BytesIO(), io.BytesIO()
    np.save(plain, np.arange(6))
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("a.npy", plain.getvalue().replace(b"(6,), ", b"(6L,),"))
    assert NpzReader(file)["a"].tolist() == list(range(6))


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress, zstandard.compress])
def test_a_map_that_grows_as_no_map_does_is_refused_early(tmp_path: Path, pack: Callable[[bytes], bytes]) -> None:
    (tmp_path / "a.osm").write_bytes(pack(bytes(64 * MIB)))
    pieces = read_unpacked(tmp_path / "a.osm", 1 << 40)
    with pytest.raises(InputError, match=r"a\.osm: unpacks to more than 100 times its size, as no map does"):
        for count, _ in enumerate(pieces):
            assert count < 16
    (tmp_path / "b.osm").write_bytes(pack(bytes(10 * MIB)))
    assert sum(map(len, read_unpacked(tmp_path / "b.osm", 1 << 40))) == 10 * MIB
