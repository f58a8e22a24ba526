"""Runs SUMO's netconvert: plain XML in, net and OpenDRIVE out, byte-identical for identical input."""

import ctypes
import os
import re
import resource
import shutil
import signal
import subprocess
from collections.abc import Sequence
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

from simbev_ros.foundation.errors import SimulationError

_OPTIONS = (
    "--no-turnarounds=true",
    "--walkingareas=true",
    "--rectangular-lane-cut=true",
    "--offset.disable-normalization=true",
    "--junctions.internal-link-detail=20",
    "--junctions.corner-detail=8",
    "--geometry.max-grade.fix=false",
    "--tls.crossing-clearance.time=15",
    "--tls.allred.time=2",
    "--precision=4",
)
_MAX_CPU_S = 300  # 27 km² of a dense city take about 15
_MAX_MEMORY_BYTES = 6 << 30
_MAX_REASON_CHARS = 400
_HEAD_BYTES = 1 << 20
_LIBC = ctypes.CDLL(None)
_ADDR_NO_RANDOMIZE = 0x0040000  # flag of Linux's personality(2)


@lru_cache(maxsize=1)
def sumo_home() -> Path:
    """Folder of the installed SUMO.

    The package is located without importing it, because its import redirects PROJ's data folder for the whole process.

    Raises:
        SimulationError: SUMO is not installed.
    """
    spec = find_spec("sumo")
    if spec is None or not spec.submodule_search_locations:
        raise SimulationError("SUMO is not installed: the package eclipse-sumo is missing")
    return Path(next(iter(spec.submodule_search_locations)))


def build_from_plain_xml(nodes: Path, edges: Path, connections: Path, net: Path, opendrive: Path) -> None:
    """Build a net and the equivalent OpenDRIVE file from plain XML, without time stamps or paths inside.

    Raises:
        SimulationError: netconvert failed; contains its message.
    """
    files = (f"--node-files={nodes}", f"--edge-files={edges}", f"--connection-files={connections}")
    run_netconvert([*files, *_OPTIONS], net, opendrive)


def run_netconvert(arguments: Sequence[str], net: Path, opendrive: Path) -> str:
    """Run netconvert to write a net and the equivalent OpenDRIVE file, without time stamps or paths inside.

    netconvert's result for roundabouts depends on the addresses of its objects, and thus on the lengths of paths.
    Therefore it runs at fixed addresses (if the system allows that), in the folder of the net, with relative file
    names.

    Returns:
        Its warnings.

    Raises:
        SimulationError: It failed, or took too much time or memory; contains its message.
    """
    home = sumo_home()
    outputs = f"--output-file={net}", f"--opendrive-output={opendrive}"
    options = [option.replace(f"{net.parent}/", "") for option in (*arguments, *outputs)]
    command = [str(home / "bin" / "netconvert"), *options]
    proj_data = str(home / "data" / "proj")
    environment = {**os.environ, "SUMO_HOME": str(home), "PROJ_DATA": proj_data, "PROJ_LIB": proj_data}
    try:
        result = subprocess.run(
            command,
            cwd=net.parent,
            env=environment,
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
            preexec_fn=_limit_process,
        )
    except OSError as error:
        raise SimulationError(f"netconvert could not run: {error}") from error
    if result.returncode == -signal.SIGXCPU:
        raise SimulationError(f"netconvert was not ready after {_MAX_CPU_S} s of computing time")
    if result.returncode != 0 or not (net.is_file() and opendrive.is_file()):
        raise SimulationError(f"netconvert failed with exit code {result.returncode}: {_reason(result.stderr)}")
    for path in (net, opendrive):
        _remove_time_stamps(path)
    return result.stderr


def _reason(stderr: str) -> str:
    """One-line reason of a failure: netconvert's first error, and the number of further ones."""
    errors = [line.removeprefix("Error: ") for line in stderr.splitlines() if line.startswith("Error: ")]
    if not errors:
        return " ".join(stderr.split())[-_MAX_REASON_CHARS:] or "no message"
    more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
    return f"{errors[0]:.{_MAX_REASON_CHARS}}{more}"


def _limit_process() -> None:
    """Fix addresses and limit memory and computing time; runs in the child process before netconvert."""
    _LIBC.personality(_ADDR_NO_RANDOMIZE)
    for kind, own_limit in ((resource.RLIMIT_AS, _MAX_MEMORY_BYTES), (resource.RLIMIT_CPU, _MAX_CPU_S)):
        soft, hard = resource.getrlimit(kind)  # at the hard limit of time, the kernel kills without SIGXCPU
        limits = (limit for limit in (soft, hard) if limit != resource.RLIM_INFINITY)
        resource.setrlimit(kind, (min((own_limit, *limits)), hard))


def _remove_time_stamps(path: Path) -> None:
    """Remove the comment and the attribute with the time of creation and the file names, which are at the beginning."""
    marked = path.rename(path.with_suffix(".marked"))
    with marked.open("rb") as source, path.open("wb") as target:
        head = source.read(_HEAD_BYTES)
        head = re.sub(rb"<!-- generated on .*?-->\n*", b"", head, count=1, flags=re.DOTALL)
        target.write(re.sub(rb'(<header [^>]*) date="[^"]*"', rb"\1", head, count=1))
        shutil.copyfileobj(source, target)
    marked.unlink()
