"""``simbev map``: figures of a map, pictures of it, and files that are not maps."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import pytest
from waiting import PATIENCE_S

from simbev_ros.assets import build_pool
from simbev_ros.foundation.cache.entries import default_cache_dir

STREETS = """<osm version="0.6">
 <node id="1" lat="50.0" lon="8.0"/> <node id="2" lat="50.0" lon="8.002"/>
 <node id="3" lat="50.001" lon="8.001"/> <node id="4" lat="50.0" lon="8.001"/>
 <way id="1"><nd ref="1"/><nd ref="4"/><nd ref="2"/><tag k="highway" v="tertiary"/></way>
 <way id="2"><nd ref="4"/><nd ref="3"/><tag k="highway" v="residential"/></way>
</osm>"""
LAUGHS = '<!DOCTYPE a [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]>\n<osm>&b;</osm>'


@pytest.fixture(scope="module", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A fresh cache of maps, surroundings and models, in which shaders need not be compiled again."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MESA_SHADER_CACHE_DIR", str(default_cache_dir().parent))
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture
def streets(tmp_path: Path) -> Path:
    path = tmp_path / "two streets.osm"
    path.write_text(STREETS)
    return path


@pytest.mark.slow
def test_json_has_the_figures_of_the_map(simbev: Callable[..., Any], streets: Path) -> None:
    facts = json.loads(simbev("map", streets, "--json").out)
    assert (facts["name"], facts["file"], facts["two_level_crossings"]) == ("two_streets", str(streets), 0)
    assert facts["datum"]["latitude_deg"] == pytest.approx(50.0005)
    assert facts["width_m"] == pytest.approx(143.4, abs=6.0)
    assert facts["lane_km"]["driving"] == pytest.approx(2 * (0.1434 + 0.1112), abs=0.05)
    assert facts["surroundings"]["triangles"] > 100
    assert facts["notes"] == [
        "no tag says on which side traffic drives: it keeps to the right, by position",
        "it has no buildings: they are generated",
    ]


def test_bounds_choose_a_part_of_a_street_map(
    simbev: Callable[..., Any], streets: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build_pool, "usable_cores", lambda: 1)  # the map above is built by processes of their own
    facts = json.loads(simbev("map", streets, "--bounds", "8.0005,49.9995,8.0015,50.0005", "--json").out)
    assert facts["bounds"] == [8.0005, 49.9995, 8.0015, 50.0005]
    assert facts["lane_km"]["driving"] == pytest.approx(2 * (0.0717 + 0.0556), abs=0.05)


def test_impossible_bounds_are_refused(refused: Callable[..., str], streets: Path) -> None:
    assert "--bounds: is '8,50'; must be west,south,east,north" in refused("map", streets, "--bounds", "8,50")
    assert "--bounds: needs a map" in refused("map", "--bounds", "8,50,8.1,50.1")
    assert "only OpenStreetMap files have parts" in refused("map", "Blocks", "--bounds", "8,50,8.1,50.1")


@pytest.mark.slow
@pytest.mark.gl
def test_pictures_are_taken_from_above_and_from_the_street(
    simbev: Callable[..., Any], streets: Path, tmp_path: Path
) -> None:
    text = simbev("map", streets, "--out", tmp_path / "pictures/two.png").out
    assert "two_streets" in text and "it has no buildings: they are generated" in text
    sizes = {path.name: cv2.imread(str(path)).shape for path in (tmp_path / "pictures").iterdir()}
    assert sizes == {"two-above.png": (900, 1812, 3), "two-street.png": (900, 1600, 3)}
    assert all(cv2.imread(str(path)).std() > 10.0 for path in (tmp_path / "pictures").iterdir())


@pytest.mark.parametrize(("suffix", "root"), [(".xodr", "OpenDRIVE"), (".osm", "osm"), (".net.xml", "net")])
@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "is empty"),
        ("<{root}>\n <a b='", ":2:2: not valid XML: unclosed token; the file ends too early"),
        (LAUGHS, ":1: document type declarations (<!DOCTYPE>) are not accepted"),
        ("<map/>", ":1: the root element must be <"),
        ("<{root}>" + "<a>" * 99_999, ":1: elements are nested more than 64 deep"),
        ("\0\0\0", ":1:1: not valid XML"),
    ],
)
def test_files_that_are_no_maps_are_refused(
    refused: Callable[..., str],
    tmp_path: Path,
    suffix: str,
    root: str,
    content: str,
    message: str,
) -> None:
    path = tmp_path / f"bad{suffix}"
    path.write_text(content.replace("{root}", root))
    error = refused("map", path)
    assert f"{path}" in error.replace("\n", "") and message in error


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Atlantis", "no map is called 'Atlantis'; towns: Blocks, Town01"),
        ("Atlantis", "files end in .xodr, .osm, .osm.xml, .net.xml"),
        ("nowhere.osm", "nowhere.osm: cannot be read: No such file or directory"),
    ],
)
def test_unknown_maps_are_refused(refused: Callable[..., str], name: str, message: str) -> None:
    assert message in refused("map", name)


def test_a_folder_is_no_map(refused: Callable[..., str], tmp_path: Path) -> None:
    folder = tmp_path / "folder.osm"
    folder.mkdir()
    assert "folder.osm: is not a file" in refused("map", folder)


def test_a_place_without_roads_is_refused(refused: Callable[..., str], streets: Path) -> None:
    assert "--at 9000 0: there is no road of two_streets near" in refused("map", streets, "--at", "9000", "0")


@pytest.mark.slow
def test_a_file_of_600_mib_is_refused_at_once_in_little_memory(tmp_path: Path) -> None:
    path = tmp_path / "huge.osm"
    with path.open("wb") as stream:
        stream.write(b"<osm>")
        stream.truncate(600 << 20)
    script = """if True:
        from pathlib import Path
        from simbev_ros.cli.main import main
        try:
            main()
        finally:
            # Not ru_maxrss, which counts the memory of the process that this one was forked from.
            status = Path("/proc/self/status").read_text()
            print(status.partition("VmHWM:")[2].split()[0])"""
    command = [sys.executable, "-c", script, "map", str(path)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert result.returncode == 2
    assert "huge.osm: has 600 MiB; at most 512 MiB are read" in result.stderr
    assert int(result.stdout) < 1 << 20, "KiB at the most"
