"""SUMO's netconvert: plain XML in, net and OpenDRIVE out, the same bytes every time."""

import os
import re
import subprocess
from functools import lru_cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from simbev_ros.errors import SimulationError

_OPTIONS = (
    "--no-turnarounds=true",
    "--crossings.guess=true",
    "--walkingareas=true",
    "--rectangular-lane-cut=true",
    "--offset.disable-normalization=true",
    "--junctions.internal-link-detail=20",
    "--junctions.corner-detail=8",
    "--precision=4",
)
_TIMEOUT_S = 120.0


@lru_cache(maxsize=1)
def sumo_home() -> Path:
    """Folder of the installed SUMO.

    The package is found without importing it: its import points PROJ's data folder elsewhere for the whole process.

    Raises:
        SimulationError: SUMO is not installed.
    """
    spec = find_spec("sumo")
    if spec is None or not spec.submodule_search_locations:
        raise SimulationError("SUMO is not installed: the package eclipse-sumo is missing")
    return Path(next(iter(spec.submodule_search_locations)))


def fingerprint() -> str:
    """What, besides its input, decides netconvert's output."""
    return "\n".join((version("eclipse-sumo"), *_OPTIONS))


def convert(nodes: Path, edges: Path, crossing_width_m: float, net: Path, opendrive: Path) -> None:
    """Build a net and its OpenDRIVE twin from plain XML, without time stamps or paths inside.

    Raises:
        SimulationError: netconvert failed; with its message.
    """
    home = sumo_home()
    command = [str(home / "bin" / "netconvert"), f"--node-files={nodes}", f"--edge-files={edges}", *_OPTIONS]
    command += [f"--default.crossing-width={crossing_width_m:g}"]
    command += [f"--output-file={net}", f"--opendrive-output={opendrive}"]
    proj_data = str(home / "data" / "proj")
    environment = {**os.environ, "SUMO_HOME": str(home), "PROJ_DATA": proj_data, "PROJ_LIB": proj_data}
    try:
        result = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=_TIMEOUT_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise SimulationError(f"netconvert could not run: {error}") from error
    if result.returncode != 0 or not (net.is_file() and opendrive.is_file()):
        raise SimulationError(f"netconvert failed with exit code {result.returncode}: {result.stderr.strip()}")
    for path in (net, opendrive):
        path.write_text(_without_time(path.read_text(encoding="utf-8")), encoding="utf-8")


def _without_time(xml: str) -> str:
    """The same XML without the comment and attribute that say when, and from which files, it was made."""
    xml = re.sub(r"<!-- generated on .*?-->\n*", "", xml, count=1, flags=re.DOTALL)
    return re.sub(r'(<header [^>]*) date="[^"]*"', r"\1", xml, count=1)
