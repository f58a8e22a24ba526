"""Generates the sources of a message package with ROS's generators, as ``rosidl_generate_interfaces`` of CMake does."""

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import cache
from io import StringIO
from pathlib import Path

from rosidl_adapter.action import convert_action_to_idl
from rosidl_adapter.msg import convert_msg_to_idl
from rosidl_adapter.srv import convert_srv_to_idl
from rosidl_generator_c import cli as generator_c
from rosidl_generator_c.cli import GenerateC
from rosidl_generator_py.cli import GeneratePython
from rosidl_parser import parser
from rosidl_typesupport_c.cli import GenerateCTypesupport
from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

from simbev_ros.foundation.installation.message_packages.definitions import MessagePackage

TYPESUPPORTS = ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")
"""Libraries for Fast DDS: the first converts messages, the second describes their types to other participants."""

_CONVERTERS: Mapping[str, Callable[..., object]] = {
    ".msg": convert_msg_to_idl,
    ".srv": convert_srv_to_idl,
    ".action": convert_action_to_idl,
}


@dataclass(frozen=True, slots=True)
class Sources:
    """Folders of generated files; each has those of the package in a folder of the package's name.

    Attributes:
        definitions: The definitions, as they are and as IDL.
        python: Python modules and the C sources of their conversions.
        by_library: C and C++ sources by suffix of the library that is made of them.
    """

    definitions: Path
    python: Path
    by_library: Mapping[str, Path]


def generate_sources(package: MessagePackage, folder: Path) -> Sources:
    """Generate the sources of a message package.

    Args:
        package: The package; the packages that its messages refer to must be installed.
        folder: Folder for the results.

    Raises:
        ValueError: A definition is wrong; the message says what the generators have printed.
    """
    os.environ["AMENT_PREFIX_PATH"] = sys.prefix  # where the generators find their templates
    printed = StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(printed), _each_definition_parsed_once(), _kinds_told_apart():
            return _generate(package, folder)
    except Exception as error:
        raise ValueError(f"{package.name}: {error}\n{printed.getvalue()}") from error


def _generate(package: MessagePackage, folder: Path) -> Sources:
    name, definitions = package.name, folder / "share"
    for path in package.definitions():
        target = definitions / name / path.parent
        _CONVERTERS[path.suffix](package.folder, name, path, target)
        (target / path.name).write_bytes((package.folder / path).read_bytes())
    idl_files = [f"{definitions / name}:{path.with_suffix('.idl')}" for path in package.definitions()]
    include_paths = [*_installed_packages(), str(definitions / name)]
    python = folder / "python"
    by_library = {
        "rosidl_generator_c": GenerateC("c"),
        TYPESUPPORTS[0]: GenerateFastRTPSCTypesupport("fastrtps_c"),
        TYPESUPPORTS[1]: GenerateIntrospectionCTypesupport("introspection_c"),
        "rosidl_typesupport_c": GenerateCTypesupport("c", typesupport_implementations=TYPESUPPORTS),
    }
    for suffix, generator in by_library.items():
        _run(generator, package, idl_files, include_paths, folder / suffix)
    _run(
        GeneratePython("py", typesupport_implementations=["rosidl_typesupport_c"]),
        package,
        idl_files,
        include_paths,
        python,
    )
    (python / name / "__init__.py").touch()
    return Sources(definitions, python, {suffix: folder / suffix for suffix in by_library})


@contextmanager
def _each_definition_parsed_once() -> Iterator[None]:
    """Let the generators share parsed definitions: otherwise each parses all of them, which takes longest."""
    parse = parser.get_ast_from_idl_string
    parser.get_ast_from_idl_string = cache(parse)
    try:
        yield
    finally:
        parser.get_ast_from_idl_string = parse


@contextmanager
def _kinds_told_apart() -> Iterator[None]:
    """Let a message and a service have the same name: the generator finds descriptions by the name of a file alone."""

    def pair_files(idl_files: Iterable[str], descriptions: Iterable[Path]) -> list[str]:
        of_kind = {(Path(path).parent.name, Path(path).stem): path for path in descriptions}
        paths = [Path(name.rpartition(":")[2]) for name in idl_files]
        return [f"{path}:{of_kind[path.parent.name, path.stem]}" for path in paths]

    build = generator_c.build_type_description_tuples
    generator_c.build_type_description_tuples = pair_files
    try:
        yield
    finally:
        generator_c.build_type_description_tuples = build


def _run(generator: object, package: MessagePackage, idl_files: list[str], include: Iterable[str], root: Path) -> None:
    output = root / package.name
    output.mkdir(parents=True)
    generator.generate(package.name, idl_files, list(include), output)  # type: ignore[attr-defined]


def _installed_packages() -> list[str]:
    """Share folders of the message packages that are installed."""
    index = Path(sys.prefix, "share", "ament_index", "resource_index", "rosidl_interfaces")
    return [str(Path(sys.prefix, "share", entry.name)) for entry in sorted(index.iterdir())]
