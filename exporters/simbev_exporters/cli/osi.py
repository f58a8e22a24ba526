"""``simbev export osi``: writes the ground truth of a dataset as trace files of ASAM OSI."""

import os
import shlex
import sys
from importlib.util import find_spec

from simbev_exporters.cli.image_options import DatasetArgument, Out
from simbev_ros.cli.agent_option import ExportedAgentOption, exported_agents
from simbev_ros.cli.console import counting_bar, make_console, plural
from simbev_ros.cli.pool import Ray, Workers, open_pool, shared_path
from simbev_ros.foundation.errors import InputError, SimbevError
from simbev_ros.foundation.installation.extras import load_extras

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
    from simbev_exporters.osi.export import export_osi
    from simbev_ros.dataset import open_dataset

    opened, out = open_dataset(shared_path(dataset, ray), threads=1), shared_path(out, ray)
    console, failed, scenes = make_console(soft_wrap=True, highlight=False), 0, 0
    pooled = open_pool(workers, ray, module=_MODULE, memory_mib=_MEMORY_MIB, reads=[dataset], writes=[out])
    with pooled as pool:
        for seen, folder in exported_agents(opened, agent, out):
            with counting_bar("messages", make_console(stderr=True), elapsed=True) as bar:
                done = export_osi(seen, folder, pool=pool, report=bar.show)
            there = done.scenes - done.made
            console.print(f"{done.messages} messages of {plural(done.scenes, 'scene')} in {folder}")
            if there:
                console.print(f"{plural(there, 'scene')} {'was' if there == 1 else 'were'} there already")
            if not done.has_lanes:
                console.print(f"there are no lanes: {load_extras()['sim'].remedy('what builds the roads')}")
            for reason in done.failures.values():
                console.print(reason, style="red")
            failed, scenes = failed + len(done.failures), scenes + len(seen.scenes)
    if failed:
        raise SimbevError(f"{failed} of {plural(scenes, 'scene')} could not be exported")


def _require_osi() -> None:
    """Refuse to export without OSI's classes."""
    if find_spec("osi3") is None:
        setup = os.environ.get("SIMBEV_COMMAND")
        pip = f"{shlex.quote(sys.executable)} -m pip install './exporters[osi]' # in the repository"
        remedy = f"{shlex.quote(setup)} setup osi" if setup else pip
        raise InputError(f"simbev export osi needs osi-python; install it: {remedy}")
