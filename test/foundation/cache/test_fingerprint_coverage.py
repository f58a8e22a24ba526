"""Fingerprints cover all that builders load, found without them: by building in fresh processes and by parsing.

A module may use the cache only with the fingerprint of itself, so that all it imports is covered.
"""

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

import simbev_ros
from simbev_ros.foundation.cache.fingerprint import fingerprint_inputs

PACKAGE = Path(simbev_ros.__file__).parent
MAP = """
from simbev_ros.maps.build import load_network
from simbev_ros.schema.scene.map_spec import MapSpec
spec = MapSpec(name="Blocks", seed=0)
network = load_network(spec, cache_dir)
"""
REGION = """
from simbev_ros.assets.regions.static_cache import Region, StaticCache
static = StaticCache(spec, network, cache_dir)
static.region(Region(0, 0))
static.far_land()
"""
MODEL = """
from simbev_ros.assets.actors.catalog import build_model, load_blueprints, load_shape
for index in (0, -1):
    blueprint = load_blueprints()[index]
    build_model(blueprint, load_shape(blueprint.name)).build_coarser()
"""
TURNS = """
from simbev_ros.scene.streets.tight_turns import np, tight_lanes
tight_lanes(network, np.empty((0, 2), np.int64))
"""
SIDEWALKS = """
from simbev_ros.simulation.world.kinematics.raised_areas import RaisedAreas
RaisedAreas.of_map(network).in_cell(0, 0, 0)
"""
PARTS = """
from simbev_ros.assets.actors.catalog import build_model, load_blueprints, load_shape
from simbev_ros.simulation.annotation.parts.part_rows import _CACHED
blueprint = load_blueprints()[0]
for make in _CACHED:
    make(build_model(blueprint, load_shape(blueprint.name)))
"""
PROGRAMS = {
    ("simbev_ros.maps.build",): MAP,
    ("simbev_ros.maps.build", "simbev_ros.assets.regions.static_cache"): MAP + REGION,
    ("simbev_ros.assets.actors.catalog",): MODEL,
    ("simbev_ros.maps.build", "simbev_ros.scene.streets.tight_turns"): MAP + TURNS,
    ("simbev_ros.maps.build", "simbev_ros.simulation.world.kinematics.raised_areas"): MAP + SIDEWALKS,
    ("simbev_ros.simulation.annotation.parts.part_rows",): PARTS,
}
"""The program that builds the content of each cache, by the root modules whose fingerprints are in its key."""
WATCHED = """
import builtins, json, sys
from pathlib import Path
cache_dir, package = Path(sys.argv[1]), sys.argv[2]
import simbev_ros.foundation.cache.fingerprint
simbev_ros.foundation.cache.fingerprint.fingerprint = lambda *roots: b"fixed"  # it reads files itself
opened, imported, real_import = set(), set(), builtins.__import__

def watch_files(event, arguments):
    file = str(arguments[0]) if event == "open" else ""
    if file.startswith(package) and not file.endswith(".py") and "__pycache__" not in file:
        opened.add(str(Path(file).relative_to(package)))

def watch_imports(name, variables=None, *arguments, **named):
    if str((variables or {{}}).get("__name__")).startswith("simbev_ros"):
        imported.add(name.partition(".")[0])
    return real_import(name, variables, *arguments, **named)

sys.addaudithook(watch_files)
builtins.__import__ = watch_imports
{program}
print(json.dumps([sorted(sys.modules), sorted(opened), sorted(imported)]))
"""


@dataclass(frozen=True)
class Loaded:
    """All that a process loaded while it built something."""

    roots: tuple[str, ...]
    modules: set[str]
    files: set[str]
    libraries: set[str]


@pytest.fixture(scope="module", params=PROGRAMS, ids=lambda roots: roots[-1].rpartition(".")[2])
def loaded(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Loaded:
    program = WATCHED.format(program=PROGRAMS[request.param])
    command = [sys.executable, "-c", program, str(tmp_path_factory.mktemp("cache")), f"{PACKAGE}/"]
    modules, files, libraries = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    return Loaded(request.param, {name for name in modules if is_ours(name)}, set(files), foreign(libraries))


def is_ours(module: str) -> bool:
    return module.partition(".")[0] == "simbev_ros"


def foreign(modules: set[str]) -> set[str]:
    """Top-level names of modules that belong neither to this package nor to Python."""
    return {name.partition(".")[0] for name in modules} - sys.stdlib_module_names - {"simbev_ros"}


def covered(kind: str, roots: tuple[str, ...]) -> set[str]:
    inputs = set().union(*(fingerprint_inputs(root) for root in roots))
    return {name.removeprefix(f"{kind} ") for name in inputs if name.startswith(f"{kind} ")}


@cache
def providers() -> dict[str, set[str]]:
    return {name: set(distributions) for name, distributions in packages_distributions().items()}


def distributions_of(libraries: set[str]) -> set[str]:
    return set().union(*(providers()[name] for name in libraries))


def test_all_modules_that_builders_load_are_covered(loaded: Loaded) -> None:
    assert len(loaded.modules) > 20
    assert loaded.modules <= covered("module", loaded.roots)


def test_all_data_that_builders_open_is_covered(loaded: Loaded) -> None:
    assert loaded.files
    assert loaded.files <= covered("data", loaded.roots)


def test_all_libraries_that_builders_import_are_covered(loaded: Loaded) -> None:
    assert {"numpy", "yaml"} <= loaded.libraries
    assert distributions_of(loaded.libraries) <= covered("library", loaded.roots)


def source_of(module: str) -> Path:
    path = PACKAGE.parent.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def parse_imports(path: Path) -> Iterator[str]:
    """Modules that a source imports or finds by name, and objects as though they were modules."""
    for node in ast.walk(ast.parse(path.read_text())):
        match node:
            case ast.Import(names=names):
                yield from (alias.name for alias in names)
            case ast.ImportFrom(module=str(module), names=names):
                yield from (module, *(f"{module}.{alias.name}" for alias in names))
            case ast.Call(ast.Name(id=name) | ast.Attribute(attr=name), args=[ast.Constant(value=str(module)), *_]):
                yield from [module] if name in {"find_spec", "import_module"} else []


@pytest.mark.parametrize("root", sorted({root for roots in PROGRAMS for root in roots}))
def test_the_imports_in_all_covered_sources_are_covered_and_no_other_library(root: str) -> None:
    modules = covered("module", (root,))
    imported = {name for module in modules for name in parse_imports(source_of(module))}
    assert {name for name in imported if is_ours(name) and source_of(name).is_file()} <= modules
    assert distributions_of(foreign(imported)) == covered("library", (root,))


@pytest.mark.parametrize("root", sorted({root for roots in PROGRAMS for root in roots}))
def test_packages_whose_data_covered_sources_read_are_covered(root: str) -> None:
    modules = covered("module", (root,))
    calls = (node for name in modules for node in ast.walk(ast.parse(source_of(name).read_text())))
    for call in calls:
        match call:
            case ast.Call(
                func=ast.Name(id="files" | "load_table") | ast.Attribute(attr="files"),
                args=[ast.Constant(value=package), *_],
            ):
                assert package in modules


def test_each_module_that_uses_the_cache_names_itself_as_root() -> None:
    users = set()
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text()
        if path.parent == PACKAGE / "foundation/cache" or "simbev_ros.foundation.cache" not in text:
            continue
        calls = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call)]
        names = {call.func.id: call for call in calls if isinstance(call.func, ast.Name)}
        if names.keys() & {"ensure_folder", "entry_path"}:
            users.add("simbev_ros." + ".".join(path.relative_to(PACKAGE).with_suffix("").parts))
            assert [ast.unparse(root) for root in names["fingerprint"].args] == ["__name__"], path
    assert users == {root for roots in PROGRAMS for root in roots}, "each cache has a program above"
