"""Map files that have travelled to a machine on which they are not at their path."""

import hashlib
from pathlib import Path

import pytest

from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.source import MAP_FILES_VARIABLE, file_of, map_spec, name_of_copy
from simbev_ros.schema.scene.map_spec import MapSpec

CONTENT = b"<OpenDRIVE/>"


@pytest.fixture
def original(tmp_path: Path) -> Path:
    path = tmp_path / "town.xodr"
    path.write_bytes(CONTENT)
    return path


@pytest.fixture
def copies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for copies."""
    folder = tmp_path / "copies"
    folder.mkdir()
    monkeypatch.setenv(MAP_FILES_VARIABLE, str(folder))
    return folder


@pytest.fixture
def spec(original: Path) -> MapSpec:
    return map_spec(str(original))


def test_the_name_of_a_copy_follows_from_its_content_alone(spec: MapSpec) -> None:
    assert name_of_copy(spec) == f"{hashlib.sha256(CONTENT).hexdigest()}.xodr"


def test_where_the_file_is_missing_its_copy_is_read(spec: MapSpec, original: Path, copies: Path) -> None:
    copy = original.rename(copies / name_of_copy(spec))
    assert file_of(spec) == copy


def test_where_the_file_exists_the_copy_is_not_looked_at(spec: MapSpec, original: Path, copies: Path) -> None:
    (copies / name_of_copy(spec)).write_text("something else")
    assert file_of(spec) == original


def test_a_copy_with_another_content_is_refused(spec: MapSpec, original: Path, copies: Path) -> None:
    original.unlink()
    (copies / name_of_copy(spec)).write_text("something else")
    with pytest.raises(InputError, match=r"has changed since the scene was drawn"):
        file_of(spec)


def test_without_file_and_copy_the_message_names_the_original(spec: MapSpec, original: Path, copies: Path) -> None:
    original.unlink()
    with pytest.raises(InputError, match=rf"^{original}: "):
        file_of(spec)


def test_without_the_variable_no_copy_is_looked_for(
    spec: MapSpec, original: Path, copies: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original.rename(copies / name_of_copy(spec))
    monkeypatch.delenv(MAP_FILES_VARIABLE)
    with pytest.raises(InputError, match=rf"^{original}: "):
        file_of(spec)
