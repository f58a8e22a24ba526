"""Keys of the cache change with all that builders depend on, and with nothing else.

Fingerprints are computed by fresh processes on a copy of the package, with libraries that consist of metadata alone.
"""

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

import simbev_ros
from simbev_ros.foundation.cache.fingerprint import fingerprint, fingerprint_inputs

MAPS, REGIONS, MODELS, TURNS = ROOTS = (
    "simbev_ros.maps.build",
    "simbev_ros.assets.regions.static_cache",
    "simbev_ros.assets.actors.catalog",
    "simbev_ros.scene.streets.tight_turns",
)
PROBE = b'''"""Imports in all forms that the package uses, and then:

import nothing from here
"""
import decimal, cv2 as vision  # comment
import simbev_ros.schema.scene.map_spec as spec
from typing import TYPE_CHECKING
from simbev_ros.maps.roads import (
    # signals (of junctions)
    levels,
    lane_kind as kind,  # (two)
)

if TYPE_CHECKING:
    from simbev_ros.schema.scene import weather

def late():
    from simbev_ros.foundation.random import stream
    find_spec("sumo"), importlib.import_module("simbev_ros.schema.palette")
'''


@dataclass(frozen=True)
class Copy:
    """A copy of the package in ``root/simbev_ros``, and libraries in ``root/libraries``."""

    root: Path

    def fingerprints(self) -> tuple[str, ...]:
        """Fingerprint of each of ``ROOTS``."""
        return tuple(self.run("fingerprint(root).hex()", *ROOTS).split())

    def run(self, expression: str, *roots: str) -> str:
        """Print an expression of ``fingerprint``, ``fingerprint_inputs`` and ``root`` for each root."""
        program = "from simbev_ros.foundation.cache.fingerprint import fingerprint, fingerprint_inputs\n"
        program += f"for root in {roots!r}: print({expression})"
        environment = {**os.environ, "PYTHONPATH": f"{self.root}:{self.root}/libraries", "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, "-S", "-c", program]
        return subprocess.run(
            command, cwd=self.root, env=environment, check=True, stdout=subprocess.PIPE, text=True
        ).stdout

    def add_library(self, name: str, version: str, file: str, content: str) -> None:
        """Install a distribution: its metadata and the file that names its modules, instead of one that is there."""
        folder = self.root / f"libraries/{name}-1.dist-info"
        folder.mkdir(parents=True, exist_ok=True)
        self.replace(folder / "METADATA", f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
        self.replace(folder / file, content)

    def replace(self, file: str | Path, content: str) -> None:
        """Write a new file where one may be."""
        path = self.root / file
        path.unlink(missing_ok=True)
        path.write_text(content)


@pytest.fixture(scope="module")
def pristine(tmp_path_factory: pytest.TempPathFactory) -> Copy:
    copy = Copy(tmp_path_factory.mktemp("pristine"))
    source = Path(simbev_ros.__file__).parent
    shutil.copytree(source, copy.root / "simbev_ros", ignore=shutil.ignore_patterns("__pycache__"))
    copy.add_library("simbev_ros", "0", "RECORD", "")
    copy.add_library("opencv-python-headless", "5.0.0", "top_level.txt", "cv2\n")
    copy.add_library("mapbox_earcut", "2.1.0", "RECORD", "mapbox_earcut/__init__.py,sha256=,\n")
    return copy


@pytest.fixture(scope="module")
def before(pristine: Copy) -> tuple[str, ...]:
    """Fingerprints of the package as it is."""
    return pristine.fingerprints()


@pytest.fixture
def copy(pristine: Copy, tmp_path: Path) -> Copy:
    """A copy to change; its files are links, so a test replaces a file and never writes into it."""
    shutil.copytree(pristine.root, tmp_path / "copy", copy_function=os.link)
    return Copy(tmp_path / "copy")


def changes(before: tuple[str, ...], after: tuple[str, ...]) -> set[str]:
    """Roots whose fingerprints differ."""
    return {root for root, old, new in zip(ROOTS, before, after, strict=True) if old != new}


@pytest.mark.parametrize(
    ("file", "changed"),
    [
        ("foundation/semantics.py", {REGIONS, MODELS, TURNS}),
        ("assets/mesh/drape.py", {REGIONS}),
        ("assets/street/__init__.py", {REGIONS}),
        ("assets/actors/shapes/vehicle.bus.yaml", {MODELS}),
        ("schema/scene/state.py", {MODELS}),
        ("scene/streets/off_tracking.py", {TURNS}),
        ("maps/towns/Blocks.yaml", {MAPS, REGIONS, TURNS}),
        ("maps/sumo/netconvert.py", {MAPS}),
        ("cli/main.py", set()),
        ("simulation/world/source.py", set()),
        ("scene/drawing/draw_scene.py", set()),
        ("config/rig.py", set()),
        ("config/evaluation.py", set()),
        ("simulation/render/lighting/sky.yaml", set()),
    ],
)
def test_an_edit_changes_the_keys_of_what_depends_on_the_file(
    copy: Copy, before: tuple[str, ...], file: str, changed: set[str]
) -> None:
    copy.replace(f"simbev_ros/{file}", (copy.root / "simbev_ros" / file).read_text() + "\n")
    assert changes(before, copy.fingerprints()) == changed


def test_bytecode_and_modules_that_no_builder_imports_change_no_key(copy: Copy, before: tuple[str, ...]) -> None:
    (copy.root / "simbev_ros/maps/__pycache__").mkdir()
    (copy.root / "simbev_ros/maps/__pycache__/build.cpython-311.pyc").touch()
    (copy.root / "simbev_ros/maps/new.py").touch()
    assert copy.fingerprints() == before


@pytest.mark.parametrize(
    ("name", "file", "content", "changed"),
    [
        ("opencv-python-headless", "top_level.txt", "cv2\n", {REGIONS}),
        ("mapbox_earcut", "RECORD", "mapbox_earcut/__init__.py,sha256=,\n", {REGIONS, MODELS}),
        ("no-builder-imports-it", "top_level.txt", "typer\n", set()),
    ],
)
def test_another_version_of_a_library_changes_the_keys_of_what_imports_it(
    copy: Copy, name: str, file: str, content: str, changed: set[str]
) -> None:
    copy.add_library(name, "7", file, content)
    before = copy.fingerprints()
    copy.add_library(name, "8", file, content)
    assert changes(before, copy.fingerprints()) == changed


def test_libraries_without_metadata_are_known_by_their_files(copy: Copy, before: tuple[str, ...]) -> None:
    (copy.root / "libraries/sumo").mkdir()
    (copy.root / "libraries/sumo/__init__.py").write_text("__version__ = '1'")
    (copy.root / "libraries/pyproj.py").write_text("")
    present = copy.fingerprints()
    assert changes(before, present) == {MAPS, REGIONS, TURNS}
    (copy.root / "libraries/sumo/__init__.py").write_text("__version__ = '1.1'")
    assert changes(present, copy.fingerprints()) == {MAPS}


def test_all_forms_of_imports_are_followed(copy: Copy) -> None:
    (copy.root / "simbev_ros/probe.py").write_bytes(PROBE)
    inputs = set(copy.run("*fingerprint_inputs(root), sep='\\n'", "simbev_ros.probe").splitlines())
    modules = {"", ".probe", ".schema.scene.map_spec", ".maps.roads", ".maps.roads.levels", ".maps.roads.lane_kind"}
    modules |= {".schema.scene.weather", ".foundation.random", ".schema.palette"}
    assert inputs > {f"module simbev_ros{name}" for name in modules} | {
        "data schema/palette.yaml",
        "library sumo",
        "python",
    }
    assert "library opencv-python-headless" in inputs
    assert not inputs & {"library decimal", "library vision", "library nothing", "library typing"}


def test_a_copy_elsewhere_has_the_same_fingerprints(copy: Copy, before: tuple[str, ...]) -> None:
    assert copy.fingerprints() == before


def test_another_minor_version_of_python_gives_another_fingerprint(monkeypatch: pytest.MonkeyPatch) -> None:
    before = fingerprint_inputs(TURNS)
    monkeypatch.setattr(sys, "version_info", (3, 99, 0))
    assert before != {**before, "python": b"3.99"} == fingerprint_inputs(TURNS)


def test_a_package_beside_this_one_is_followed_like_this_one() -> None:
    inputs = fingerprint_inputs("simbev_exporters.nuscenes.export")
    assert {"module simbev_exporters.nuscenes.taxonomy", "module simbev_ros.export.parts"} <= inputs.keys()
    assert not [name for name in inputs if name.startswith("library simbev")]


def test_roots_that_do_not_exist_are_refused() -> None:
    with pytest.raises(ValueError, match=r"no such module: simbev_ros\.maps\.typo$"):
        fingerprint(MAPS, "simbev_ros.maps.typo")
