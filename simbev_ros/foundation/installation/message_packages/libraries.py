"""Compiles the sources of a message package into its libraries, with the names and contents that ROS gives them."""

import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from simbev_ros.foundation.installation.message_packages.sources import TYPESUPPORTS, Sources

REMEDY = "apt-get install g++ python3-dev"
_FLAGS = ("-O1", "-fPIC", "-shared", "-w", "-Wl,--as-needed")
_MAX_MESSAGE = 300
_DESCRIPTION = "__description.c"
_RUNTIME = (
    *("rosidl_runtime_c", "rosidl_typesupport_c", *TYPESUPPORTS, "rosidl_typesupport_fastrtps_cpp"),
    *("rcutils", "rmw", "fastcdr"),
)


class CompilationError(Exception):
    """No compiler, no headers of Python, or sources that do not compile; the message says which."""


def find_compiler_problem() -> str | None:
    """Why nothing can be compiled on this machine; None if it can."""
    if shutil.which("gcc") is None or shutil.which("g++") is None:
        return "no C++ compiler"
    if not Path(sysconfig.get_path("include"), "Python.h").is_file():
        return "no headers of Python"
    return None


def compile_libraries(name: str, sources: Sources, folder: Path) -> None:
    """Compile the libraries of a message package, and the Python extension that loads them.

    Args:
        name: Name of the package.
        sources: Its generated sources. The extension is written next to the Python modules.
        folder: Folder for the libraries.

    Raises:
        CompilationError: The machine lacks something, or the compiler fails.
    """
    if problem := find_compiler_problem():
        raise CompilationError(f"{problem}: {REMEDY}")
    folder.mkdir()
    prefix = Path(sys.prefix)
    includes = [*sources.by_library.values(), prefix / "include", *sorted((prefix / "include").glob("*/"))]
    includes += [Path(sysconfig.get_path("include")), Path(np.get_include())]
    needed = [prefix / "lib" / f"lib{each}.so" for each in _RUNTIME]
    made: list[Path] = []
    python = sources.python / name
    parts = [(suffix, _sources(root)) for suffix, root in sources.by_library.items()]
    parts.append(("rosidl_generator_py", sorted(python.rglob("*_s.c"))))
    for suffix, files in parts:
        library = folder / f"lib{name}__{suffix}.so"
        others = sorted((prefix / "lib").glob(f"lib*__{suffix}.so"))
        bases = sorted((prefix / "lib").glob("lib*__rosidl_generator_c.so"))
        _compile(files, library, includes, [*made, *others, *bases, *needed])
        made.append(library)
    entry, suffix = f"{name}_s__rosidl_typesupport_c", sysconfig.get_config_var("EXT_SUFFIX")
    others = sorted((prefix / "lib").glob("lib*__rosidl_typesupport_c.so"))
    _compile(sorted(python.glob("*.ep.*.c")), python / f"{entry}{suffix}", includes, [*made, *others, *needed])


def _sources(root: Path) -> list[Path]:
    return sorted(path for pattern in ("*.c", "*.cpp") for path in root.rglob(pattern))


def _compile(files: Sequence[Path], library: Path, includes: Iterable[Path], libraries: Iterable[Path]) -> None:
    """Compile C and C++ files into a library, which refers to those of the given ones that it uses."""
    files = _joined(files, library)
    words = [*_FLAGS, *(f"-I{folder}" for folder in includes), f"-Wl,-soname,{library.name}"]
    words += [*map(str, files), *map(str, libraries), "-lstdc++", "-o", str(library)]
    done = subprocess.run(
        ["gcc", *words],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        errors = [line for line in done.stderr.splitlines() if re.search(r"\berror\b", line)] or ["no message"]
        raise CompilationError(f"{library.name}: {errors[0]:.{_MAX_MESSAGE}}")


def _joined(files: Sequence[Path], library: Path) -> list[Path]:
    """Fewer files with the same content: most time is spent on headers, which the files of a library share.

    Descriptions of types stay apart, because their static names are the same in each.
    """
    apart = [path for path in files if path.name.endswith(_DESCRIPTION)]
    joined = []
    for suffix in (".c", ".cpp"):
        together = [path for path in files if path.suffix == suffix and path not in apart]
        if together:
            joined.append(library.with_suffix(f".joined{suffix}"))
            joined[-1].write_text("".join(f'#include "{path}"\n' for path in together), encoding="utf-8")
    return [*apart, *joined]
