"""Packs a message package as a wheel, so that pip installs, lists and replaces it like any other."""

import base64
import hashlib
import sysconfig
import zipfile
from collections.abc import Iterator
from pathlib import Path

from packaging.tags import sys_tags

from simbev_ros.foundation.installation.message_packages.definitions import MessagePackage
from simbev_ros.foundation.installation.message_packages.sources import Sources

_GENERATOR = "simbev_ros"


def pack_wheel(package: MessagePackage, version: str, sources: Sources, libraries: Path, folder: Path) -> Path:
    """Pack Python modules, libraries, definitions and entries of the ament index.

    Args:
        package: The message package.
        version: Version of the distribution.
        sources: The generated sources, with the compiled extension next to the Python modules.
        libraries: Folder with the compiled libraries, which go where ROS's wheels have theirs.
        folder: Folder for the wheel.

    Returns:
        Path of the wheel.
    """
    name, data = f"{package.distribution}-{version}", f"{package.distribution}-{version}.data/data"
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    tag = next(f"{each.interpreter}-{each.abi}-{platform}" for each in sys_tags())
    wheel = folder / f"{name}-{tag}.whl"
    index = f"{data}/share/ament_index/resource_index"
    interfaces = "".join(f"{path.as_posix()}\n" for path in package.definitions())
    with _Wheel(wheel, f"{name}.dist-info") as archive:
        for path in _python_files(sources.python):
            archive.add(path.relative_to(sources.python).as_posix(), path.read_bytes())
        for path in sorted(libraries.glob("*.so")):
            archive.add(f"{data}/lib/{path.name}", path.read_bytes())
        for root in (sources.definitions, *sources.by_library.values()):
            for path in _interface_files(root):
                archive.add(f"{data}/share/{path.relative_to(root).as_posix()}", path.read_bytes())
        archive.add(f"{data}/share/{package.name}/package.xml", package.manifest())
        archive.add(f"{index}/packages/{package.name}", b"")
        archive.add(f"{index}/rosidl_interfaces/{package.name}", interfaces.encode())
        archive.finish(
            {
                "METADATA": f"Metadata-Version: 2.1\nName: {package.distribution}\nVersion: {version}\n"
                f"Summary: The ROS package {package.name}, made on this machine\nLicense: {package.license}\n",
                "WHEEL": f"Wheel-Version: 1.0\nGenerator: {_GENERATOR}\nRoot-Is-Purelib: false\nTag: {tag}\n",
            }
        )
    return wheel


def _python_files(root: Path) -> Iterator[Path]:
    extension = sysconfig.get_config_var("EXT_SUFFIX")
    return (path for path in sorted(root.rglob("*")) if path.suffix == ".py" or path.name.endswith(extension))


def _interface_files(root: Path) -> Iterator[Path]:
    """Definitions, IDL, and JSON descriptions of types."""
    suffixes = (".msg", ".srv", ".action", ".idl", ".json")
    return (path for path in sorted(root.rglob("*")) if path.suffix in suffixes)


class _Wheel:
    """A wheel that is written: files first, then ``finish``."""

    def __init__(self, path: Path, dist_info: str) -> None:
        self._archive = zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1)
        self._dist_info, self._record = dist_info, ""

    def __enter__(self) -> "_Wheel":
        return self

    def __exit__(self, *_: object) -> None:
        self._archive.close()

    def add(self, name: str, content: bytes) -> None:
        """Add a file, with its line in the record."""
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        self._record += f"{name},sha256={digest},{len(content)}\n"
        self._archive.writestr(name, content)

    def finish(self, files: dict[str, str]) -> None:
        """Add the files of the dist-info folder, and the record."""
        for name, text in files.items():
            self.add(f"{self._dist_info}/{name}", text.encode())
        record = f"{self._dist_info}/RECORD"
        self._archive.writestr(record, f"{self._record}{record},,\n")
