"""The packages that set-up installs bring every library of the system that the wheels need, and no more."""

import os
import platform
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from debian_packages import closure, package_of, package_of_file

from simbev_ros.foundation.installation import system_libraries
from simbev_ros.foundation.installation.system_libraries import find_missing_libraries, load_packages
from tools.system_libraries.derivation import EXTRAS, ROOT, derive_needed_libraries
from tools.system_libraries.distributions import DistributionGraph
from tools.system_libraries.linkage import read_linkage

REPOSITORY = Path(__file__).parents[2]
BEFORE = ["libegl1", "libegl-mesa0", "libgl1-mesa-dri", "libgl1", "libgles2", "libusb-1.0-0", "libgomp1", "libx11-6"]
"""The list that was guessed, and that a bare machine refuted."""

needs_dpkg = pytest.mark.skipif(shutil.which("dpkg-query") is None, reason="there is no dpkg to ask")
needs_wheels = pytest.mark.skipif(
    platform.machine() != "x86_64" or find_spec("ros_wheels_bootstrapper") is None,
    reason="the table is that of the wheels for x86-64, ROS's included",
)


@pytest.fixture(scope="module")
def needed() -> dict[str, list[str]]:
    return derive_needed_libraries(DistributionGraph(ROOT, EXTRAS))


def packages() -> list[str]:
    return [package for table in load_packages().values() for package in table.values()]


def unprovided(needed: dict[str, list[str]], packages: list[str]) -> set[str]:
    """Libraries that no package in the closure of these brings."""
    pulled_in = closure(packages)
    return {library for library in needed if package_of(library) not in pulled_in}


@pytest.mark.slow
@needs_dpkg
@needs_wheels
def test_every_needed_library_is_in_a_package_that_set_up_installs(needed: dict[str, list[str]]) -> None:
    assert {library: needed[library] for library in unprovided(needed, packages())} == {}


@pytest.mark.slow
@needs_dpkg
@needs_wheels
def test_the_list_that_was_guessed_is_found_incomplete(needed: dict[str, list[str]]) -> None:
    assert {"libatomic.so.1", "libXrender.so.1"} <= unprovided(needed, BEFORE)


@pytest.mark.slow
@needs_dpkg
@needs_wheels
def test_the_table_is_the_derived_one(needed: dict[str, list[str]]) -> None:
    table = load_packages()["linked"]
    assert set(table) == {library for library in needed if package_of(library) != "libc6"}
    assert {library: package_of(library) for library in table} == table


@needs_dpkg
@pytest.mark.gl
def test_whatever_a_process_really_maps_is_in_a_package_that_set_up_installs() -> None:
    maps = _maps_after(
        "import av, cv2, isal.isal_zlib, libsumo, pyarrow.parquet, pyproj, rclpy, scipy.spatial, shapely, simplejpeg",
        "import zlib_ng.zlib_ng",
        "from simbev_ros.simulation.raycast import embree",
        "from simbev_ros.simulation.render.gl import context",
        "context.describe_renderer()",
    )
    of_python = _maps_after("import bz2, ctypes, decimal, lzma, pyexpat, sqlite3, ssl, uuid, zlib")
    apart = (
        str(Path(sys.prefix).resolve()),
        str(Path(os.__file__).parent),
    )  # what wheels and Python's own library bring
    mapped = {path for path in maps - of_python if ".so" in path and not path.startswith(apart)}
    mapped = {path for path in mapped if "/libnss_" not in path}  # how names of users are found is the machine's choice
    assert any("libatomic" in path for path in mapped) and any("LLVM" in path for path in mapped)
    pulled_in = closure(packages())
    assert {path for path in mapped if package_of_file(Path(path)) not in pulled_in} == set()


def _maps_after(*statements: str) -> set[str]:
    """Files that a Python process maps after it has run these."""
    code = "\n".join([*statements, "print(open('/proc/self/maps').read())"])
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(re.findall(r"(/\S+)$", answer.stdout, re.MULTILINE))


def test_the_script_installs_the_packages_of_the_table() -> None:
    script = (REPOSITORY / "simbev").read_text(encoding="utf-8")
    line = next(line for line in script.splitlines() if line.strip().startswith("libraries="))
    command = f"here={REPOSITORY}; {line.strip()}; echo $libraries"
    listed = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=True).stdout.split()
    assert listed == sorted(set(packages()))


def test_a_missing_library_is_named_with_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(system_libraries, "_is_found", lambda name: name != "libatomic.so.1")
    assert find_missing_libraries() == [("libatomic.so.1", "libatomic1")]


def test_nothing_is_missing_here() -> None:
    assert find_missing_libraries() == []


@pytest.mark.skipif(shutil.which("readelf") is None, reason="there is no readelf to compare with")
def test_needed_libraries_are_those_that_readelf_prints() -> None:
    spec = find_spec("sumo")
    assert spec is not None and spec.origin is not None
    program = Path(spec.origin).parent / "bin" / "netconvert"
    printed = subprocess.run(["readelf", "-d", program], capture_output=True, text=True, check=True).stdout
    linkage = read_linkage(program)
    assert linkage is not None
    assert list(linkage.needed) == re.findall(r"\(NEEDED\).*\[(.*)\]", printed)
    assert [folder.is_dir() for folder in linkage.search_path] == [True]


def test_files_that_are_not_elf_link_against_nothing(tmp_path: Path) -> None:
    text, damaged = tmp_path / "text.so", tmp_path / "damaged.so"
    text.write_text("INPUT(libm.so.6)")
    damaged.write_bytes(b"\x7fELF" + bytes(range(40)))
    assert read_linkage(text) is None
    assert read_linkage(damaged) is None
