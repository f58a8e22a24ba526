"""Names that the product itself gives are allowed, and names that could lead elsewhere are not."""

from pathlib import Path

import pytest
from pydantic import TypeAdapter, ValidationError

from simbev_ros.config.map_files import MAP_SUFFIXES
from simbev_ros.config.names import Name, TopicName
from simbev_ros.maps.source import known_maps, map_spec
from simbev_ros.schema.scene.map_spec import MapSpec

NAME, TOPIC_NAME = TypeAdapter(Name), TypeAdapter(TopicName)
PATHS = ["", ".", "..", "../x", "/x", "a/b", "a\\b", ".hidden", "-option"]
MARKUP = ["a b", "a\n", "a\0", "<b>", "[/red]", "é", "\x1b[2J"]


@pytest.mark.parametrize("name", [*known_maps(), "Blocks-0000", "train", "cam_front", "my_town", "6th-street"])
def test_names_that_the_product_writes_are_allowed(name: str) -> None:
    assert NAME.validate_python(name) == name


@pytest.mark.parametrize("name", [*PATHS, *MARKUP, "x" * 65])
def test_names_that_could_lead_elsewhere_are_refused(name: str) -> None:
    for adapter in (NAME, TOPIC_NAME):
        with pytest.raises(ValidationError):
            adapter.validate_python(name)


@pytest.mark.parametrize("stem", ["corner", "..", "a b/c", "Straße 7", "-x-", "m" * 200, "[x]", "line\nbreak"])
@pytest.mark.parametrize("suffix", MAP_SUFFIXES)
def test_every_map_file_gets_a_name_and_keeps_its_path(stem: str, suffix: str, tmp_path: Path) -> None:
    file = tmp_path / f"{stem}{suffix}"
    file.parent.mkdir(exist_ok=True)
    file.write_text("<x/>")
    spec = map_spec(str(file))
    assert MapSpec.model_validate_json(spec.model_dump_json()) == spec and spec.path == str(file)


@pytest.mark.parametrize("path", ["/etc/passwd", "a.osm", "../a.osm", "/a\0.osm", "/" + "a" * 5000 + ".osm"])
def test_paths_that_are_no_map_file_are_refused(path: str) -> None:
    with pytest.raises(ValidationError):
        MapSpec(name="a", path=path)
