"""YAML files of users and strangers: whatever is in them, an error names the file and the line, and none takes long."""

import os
from pathlib import Path

import pytest

from simbev_ros.config import yaml_file
from simbev_ros.config.yaml_file import YamlFile
from simbev_ros.foundation.errors import InputError


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"a: !!timestamp x", "'x' is not a valid timestamp in"),
        (b"a: 1\nb: 2001-99-99", "'2001-99-99' is not a valid timestamp in \"it.yaml\", line 2"),
        (b"a: !!bool x", "'x' is not a valid bool"),
        (b"a: !!int x", "'x' is not a valid int"),
        (b"a: " + b"9" * 5000, "a number has 5,000 characters; allowed are 64"),
        (b"a: !!float x", "'x' is not a valid float"),
        (b"a: !!python/object:os.system x", "could not determine a constructor"),
        (b"[" * 500, "nested deeper than 64 levels"),
        (b"{a: " * 500, "nested deeper than 64 levels"),
        (b"\n".join(b" " * depth + b"a:" for depth in range(70)), "nested deeper than 64 levels"),
        (b'a: "x\\0"', "it.yaml:1: a text contains a character that no text may contain"),
        (b'a: 1\nb: "\\ud800"', "it.yaml:2: a text contains a character"),
        (b"a: \xff", "cannot be read: 'utf-8' codec can't decode byte"),
    ],
    ids=lambda value: value[:24].decode(errors="replace") if isinstance(value, bytes) else "",
)
def test_every_error_is_one_of_ours(tmp_path: Path, text: bytes, message: str) -> None:
    (tmp_path / "it.yaml").write_bytes(text)
    with pytest.raises(InputError) as refused:
        YamlFile(tmp_path / "it.yaml")
    assert str(refused.value).startswith(f"{tmp_path}/it.yaml") and message in str(refused.value)


def test_the_number_of_values_is_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(yaml_file, "MAX_YAML_VALUES", 100)
    (tmp_path / "it.yaml").write_text("[" + "0," * 100 + "]")
    with pytest.raises(InputError, match=r"it\.yaml: not valid YAML: more than 100 values"):
        YamlFile(tmp_path / "it.yaml")


def test_values_and_lines_are_read(tmp_path: Path) -> None:
    (tmp_path / "it.yaml").write_text("a: &x [1, 2.5]\nb:\n  c: *x\n")
    file = YamlFile(tmp_path / "it.yaml")
    assert file.data == {"a": [1, 2.5], "b": {"c": [1, 2.5]}} and file.line_of(["b", "c"]) == 1
    (tmp_path / "empty.yaml").touch()
    assert YamlFile(tmp_path / "empty.yaml").data is None


def test_only_regular_files_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path, Path("/dev/zero")):
        with pytest.raises(InputError, match=f"{path}: is not a file"):
            YamlFile(path)


@pytest.mark.parametrize("number", ["1" * 50_000, "1:" * 25_000 + "1", "1." + "0" * 50_000, "0x" + "f" * 50_000])
def test_numbers_that_take_long_to_read_are_refused(tmp_path: Path, number: str) -> None:
    (tmp_path / "a.yaml").write_text(f"a: 1\nseed: {number}\n")
    with pytest.raises(InputError, match=r"a number has 50,00\d characters; allowed are 64 in .a\.yaml., line 2"):
        YamlFile(tmp_path / "a.yaml")
