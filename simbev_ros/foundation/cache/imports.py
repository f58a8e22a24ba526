"""Modules, data files and libraries that a module depends on, found by following the imports in the sources.

In: names of root modules, of this package or of one that is installed next to it. Out: the sources and the data files
that decide what they compute, and the top-level names of the libraries that they import. Sources are searched with
regular expressions: parsing them takes a hundred times longer, and each process needs the result as it starts.
"""

import hashlib
import importlib.util
import os
import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

_FOLDER = Path(__file__).parents[2]
_ITEM = rb"[\w.]+(?:[ \t]+as[ \t]+\w+)?"
_FROM = re.compile(rb"\n[ \t]*from[ \t]+([\w.]+)[ \t]+import[ \t]+(?:\(([^)]*)\)|([^\n]*))")
_IMPORT = re.compile(rb"\n[ \t]*import[ \t]+(%s(?:[ \t]*,[ \t]*%s)*)[ \t]*(?=\n)" % (_ITEM, _ITEM))
_BY_NAME = (re.compile(rb'find_spec\("([\w.]+)"'), re.compile(rb'import_module\("([\w.]+)"'))
_COMMENT = re.compile(rb"#[^\n]*")
_NAME = re.compile(rb"([\w.]+)(?:\s+as\s+\w+)?")


@dataclass(frozen=True)
class Dependencies:
    """All that root modules depend on.

    Attributes:
        modules: SHA-256 of the source of each module of the packages, by the module's name.
        data: SHA-256 of each file that is not source code, beside the modules, by its path in its package.
        libraries: Top-level names of the imported modules that belong neither to the packages nor to Python.
    """

    modules: dict[str, bytes]
    data: dict[str, bytes]
    libraries: frozenset[str]


@dataclass(frozen=True)
class _Tree:
    """The files of a package with all that are in it.

    Attributes:
        folder: The package's folder.
        sources: Path of each module, by its name; a package has that of its ``__init__.py``.
        data: Paths of all other files in each package, by the package's name.
    """

    folder: Path
    sources: dict[str, Path]
    data: dict[str, list[Path]]


def follow_imports(root_modules: Iterable[str]) -> Dependencies:
    """Collect the modules that roots import, directly or through others, with their data and libraries.

    They are those of this package and of the packages of the roots. Imports inside functions and for type checkers
    count, and so do ``find_spec`` and ``import_module`` with a literal.

    Args:
        root_modules: Full names, such as ``simbev_ros.maps.build``.

    Raises:
        ValueError: A root module does not exist.
    """
    waiting = list(root_modules)
    trees = [_find_files(folder) for folder in _package_folders(waiting)]
    sources = {name: path for tree in trees for name, path in tree.sources.items()}
    if unknown := [name for name in waiting if name not in sources]:
        raise ValueError(f"no such module: {', '.join(unknown)}")
    modules: dict[str, bytes] = {}
    libraries: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name in modules:
            continue
        modules[name], imported = _read_source(sources[name])
        waiting += [each for each in (*imported, name.rpartition(".")[0]) if each in sources]
        libraries |= {each.partition(".")[0] for each in imported}
    data = {
        path.relative_to(tree.folder).as_posix(): hashlib.sha256(path.read_bytes()).digest()
        for tree in trees
        for name in modules
        for path in tree.data.get(name, ())
    }
    return Dependencies(
        modules, data, frozenset(libraries - sys.stdlib_module_names - {tree.folder.name for tree in trees})
    )


def _package_folders(modules: Iterable[str]) -> Iterator[Path]:
    """Folders of this package and of the installed ones that modules belong to."""
    yield _FOLDER
    for package in sorted({name.partition(".")[0] for name in modules} - {_FOLDER.name}):
        spec = importlib.util.find_spec(package)
        yield from map(Path, (spec and spec.submodule_search_locations) or ())


@cache
def _find_files(package_folder: Path) -> _Tree:
    """List a package; a folder without ``__init__.py`` belongs to the package above it."""
    tree, package_of = _Tree(package_folder, {}, {}), {package_folder.parent: ""}
    for path, folders, files in os.walk(package_folder):
        folder = Path(path)
        folders[:] = [name for name in folders if name != "__pycache__"]
        package = package_of[folder.parent]
        if "__init__.py" in files:
            package = f"{package}.{folder.name}".lstrip(".")
            tree.sources[package] = folder / "__init__.py"
        package_of[folder] = package
        for name in files:
            if not name.endswith(".py"):
                tree.data.setdefault(package, []).append(folder / name)
            elif name != "__init__.py":
                tree.sources[f"{package}.{name.removesuffix('.py')}"] = folder / name
    return tree


@cache
def _read_source(path: Path) -> tuple[bytes, frozenset[str]]:
    """SHA-256 of a module's source, and the full names that it imports: of modules, and of objects in them."""
    source = path.read_bytes()
    return hashlib.sha256(source).digest(), frozenset(name.decode() for name in _imported_names(source))


def _imported_names(source: bytes) -> Iterator[bytes]:
    """Full names in import statements, as they are written."""
    source = b"\n" + _COMMENT.sub(b"", source)
    for module, in_parentheses, in_line in _FROM.findall(source):
        yield module
        for name in _NAME.findall(in_parentheses or in_line):
            yield module + b"." + name
    for names in _IMPORT.findall(source):
        yield from _NAME.findall(names)
    for pattern in _BY_NAME:
        yield from pattern.findall(source)
