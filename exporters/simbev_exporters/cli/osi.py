"""``simbev export osi``: writes the ground truth of a dataset as trace files of ASAM OSI."""

import os
import shlex
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from simbev_exporters.cli.image_options import DatasetArgument, Out
from simbev_exporters.cli.pooled_export import export_agents, show_earlier
from simbev_ros.cli.agent_option import ExportedAgentOption
from simbev_ros.cli.pool import Ray, Workers
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.installation.extras import load_extras

if TYPE_CHECKING:
    from simbev_exporters.osi.export import Exported

_MODULE, _MEMORY_MIB = "simbev_exporters.osi.export", 1024


def export_osi(
    dataset: DatasetArgument,
    out: Out,
    agent: ExportedAgentOption = None,
    workers: Workers = None,
    ray: Ray = None,
) -> None:
    """Write an MCAP file for each finished scene with an osi3.GroundTruth for each tick, by ASAM OSI's conventions.

    Coordinates are those of the frame map. Messages have all actors, the bulbs of traffic lights, signs around the
    agent, weather and, in the first message, lanes and their boundaries. The agent's vehicle is the host vehicle.

    It needs osi-python, the extra osi of the exporters. After Ctrl-C or a crash the same command continues where it
    stopped.

    [bold]Examples[/]

    simbev export osi datasets/first --out osi
    """
    _require_osi()
    from simbev_exporters.osi.export import export_osi as export

    export_agents(
        *(dataset, out, agent, workers, ray),
        module=_MODULE,
        memory_mib=_MEMORY_MIB,
        unit="messages",
        export=lambda seen, folder, pool, report: export(seen, folder, pool=pool, report=report),
        report=_report,
    )


def _report(done: "Exported", out: Path, console: Console) -> None:
    """Print what an export has made, and what is missing in it."""
    console.print(f"{done.messages} messages of {plural(done.scenes, 'scene')} in {out}")
    show_earlier(done, console)
    if not done.has_lanes:
        console.print(f"there are no lanes: {load_extras()['sim'].remedy('what builds the roads')}")


def _require_osi() -> None:
    """Refuse to export without OSI's classes."""
    if find_spec("osi3") is None:
        setup = os.environ.get("SIMBEV_COMMAND")
        pip = f"{shlex.quote(sys.executable)} -m pip install './exporters[osi]' # in the repository"
        remedy = f"{shlex.quote(setup)} setup osi" if setup else pip
        raise InputError(f"simbev export osi needs osi-python; install it: {remedy}")
