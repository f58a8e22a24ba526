"""``simbev doctor``: checks whether this machine has everything that simbev needs."""

import os
import platform
import shutil
import sys
from collections.abc import Callable, Iterator
from importlib import metadata, util
from pathlib import Path
from typing import Annotated, NamedTuple

import typer
from rich.table import Table
from rich.text import Text

from simbev_ros.cli.console import make_console, own_command
from simbev_ros.foundation.errors import SimbevError
from simbev_ros.foundation.installation.extras import install_command, load_extras
from simbev_ros.foundation.installation.shell_variables import settle_shell
from simbev_ros.foundation.installation.shipped_files import PACKAGE
from simbev_ros.foundation.loopback import loopback_problem
from simbev_ros.foundation.process_limits import GRAPH_NEEDS, limit_problems


class Finding(NamedTuple):
    """One line of the report; ``fine`` is None for mere information."""

    subject: str
    found: str
    fine: bool | None = None


def doctor(
    fix: Annotated[
        bool,
        typer.Option("--fix", help="Make the ROS message packages that are missing, with this machine's compiler."),
    ] = False,
) -> None:
    """Check Python, ROS, renderer, ray caster, traffic simulator and memory of this machine.

    Exit code 1 if something that is needed is missing. Where only datasets are read, the simulator is not.

    [bold]Examples[/]

    simbev doctor

    simbev doctor --fix    make tf2_msgs, vision_msgs and other packages, for /tf and detections live
    """
    if fix:
        _make_message_packages()
    table = Table("", "part", "found", box=None)
    with make_console(stderr=True).status("looking at this machine"):
        findings = list(_findings())
    for finding in findings:
        mark = {True: Text("✓", "green"), False: Text("✗", "red"), None: Text("·")}[finding.fine]
        table.add_row(mark, finding.subject, finding.found)
    make_console().print(table)
    if any(finding.fine is False for finding in findings):
        raise typer.Exit(1)


def _findings() -> Iterator[Finding]:
    yield Finding("Python", platform.python_version(), True)
    if not set(load_extras()["sim"].modules) <= set(load_extras()["sim"].missing):
        yield from _simulator()
    free_gib = shutil.disk_usage(".").free / 2**30
    yield Finding("disk", f"{free_gib:.1f} GiB free here", free_gib > 2)
    for extra in load_extras().values():
        found = f"not installed: {install_command(extra.name)}" if extra.missing else "installed"
        yield Finding(f"extra {extra.name}", f"{extra.use}, {found}")


def _simulator() -> Iterator[Finding]:
    ros = load_extras()["wheels"]
    memory_gib = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    yield Finding("machine", f"{os.cpu_count()} cores, {memory_gib:.0f} GiB of memory")
    for problem in limit_problems("a graph", GRAPH_NEEDS):
        yield Finding("limits", problem, False)
    broken = loopback_problem()
    yield Finding("network", broken or "the loopback interface carries messages", broken is None)
    yield from _libraries()
    for variable in settle_shell(os.environ):
        yield Finding(variable.name, f"{variable.value}: {variable.effect}")
    if ros.missing:
        yield Finding("ROS 2", f"not installed: {install_command(ros.name)}, or source a ROS 2 Jazzy", False)
    else:
        yield _checked("ROS 2", _ros)
        yield from _message_packages()
        yield _package_index()
    yield from _renderers()
    yield _checked("ray caster", _ray_caster)
    yield _checked("traffic", _traffic)
    yield _shared_memory()


def _libraries() -> Iterator[Finding]:
    """The missing shared libraries that the installed wheels need from the system, with their packages."""
    from simbev_ros.foundation.installation.system_libraries import find_missing_libraries

    missing = find_missing_libraries()
    for library in missing:
        yield Finding("libraries", f"{library.name} is missing: apt-get install {library.package}", False)
    if not missing:
        yield Finding("libraries", "all that the installed wheels need of the system are there", True)


def _checked(subject: str, check: Callable[[], str]) -> Finding:
    try:
        return Finding(subject, check(), True)
    except (ImportError, OSError, SimbevError) as error:
        return Finding(subject, f"{error}", False)


def _ros() -> str:
    from simbev_ros.ros.graph.environment import describe_ros

    origin = "wheels" if _installed("ros-rclpy") else f"{os.environ.get('ROS_DISTRO', 'unknown')} of this machine"
    return f"rclpy from {origin}, {describe_ros()}"


def _make_message_packages() -> None:
    """Make and install the missing message packages."""
    from simbev_ros.foundation.installation.message_packages.installer import install_missing

    console = make_console(stderr=True)
    with console.status("looking for message packages") as status:
        made = install_missing(lambda package: status.update(f"making {package.name}"))
    for package in made:
        console.print(f"made {package.name} {package.version}: {package.use}")


def _message_packages() -> Iterator[Finding]:
    """The message packages that ROS's wheels lack."""
    from simbev_ros.foundation.installation.message_packages.installer import describe_remedy, survey_packages

    remedy = describe_remedy()
    for state in survey_packages():
        if state.is_current:
            found = f"installed: {state.package.use}"
        elif state.is_there:
            found = f"made from older definitions: {remedy}"
        else:
            found = f"no {state.package.use} (bags are not affected): {remedy}"
        yield Finding(state.package.name, found)


def _package_index() -> Finding:
    """Whether ``ros2 pkg`` and ``ros2 launch`` find this package, once ``simbev env`` is sourced."""
    command = f"source <({own_command()} env)"
    marker = Path(sys.prefix) / "share" / "ament_index" / "resource_index" / "packages" / PACKAGE
    if not marker.exists():
        return Finding("ros2 command line", f"does not find {PACKAGE} in {sys.prefix}; ./simbev setup puts it there")
    if shutil.which("ros2") is None:
        return Finding("ros2 command line", "not installed: ROS's wheels lack it; an installed ROS 2 Jazzy has it")
    return Finding("ros2 command line", f"finds {PACKAGE} after {command}", True)


def _renderers() -> Iterator[Finding]:
    """The renderer of the cameras, and the state of every EGL device: used, in reserve, or why it cannot be used."""
    from simbev_ros.simulation.render.gl.context import describe_renderer, survey_devices

    renderer = _checked("renderer", describe_renderer)
    yield renderer
    try:
        surveys = survey_devices()
    except SimbevError:  # reported by the line of the renderer
        return
    gpus = sum(survey.renderer is not None and not survey.device.software for survey in surveys)
    for survey in surveys:
        if survey.renderer is None:
            found = f"{survey.device.name}: {survey.reason}"
        elif survey.device.software and gpus:
            found = f"in reserve, there is a GPU: {survey.renderer}"
        else:
            found = f"used: {survey.renderer}" + (", by camera processes in turn" if gpus > 1 else "")
        yield Finding(f"EGL device {survey.device.index}", found)


def _ray_caster() -> str:
    name = next((name for name in ("open3d-cpu", "open3d") if _installed(name)), None)
    if name is None or util.find_spec("open3d") is None:
        raise ImportError("neither open3d-cpu nor open3d is installed")
    return f"Embree of {name} {metadata.version(name)}"


def _traffic() -> str:
    return f"SUMO {metadata.version('libsumo')}"


def _shared_memory() -> Finding:
    try:
        size_mib = shutil.disk_usage("/dev/shm").total / 2**20
    except OSError as error:
        return Finding("/dev/shm", str(error), False)
    enough = size_mib >= 1024
    return Finding(
        "/dev/shm", f"{size_mib:.0f} MiB" + ("" if enough else "; the graph wants 1024 (--shm-size)"), enough
    )


def _installed(distribution: str) -> bool:
    try:
        metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return False
    return True
