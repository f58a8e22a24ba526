"""Nets of SUMO's own generator, as foreign maps."""

import subprocess
from pathlib import Path

from simbev_ros.maps.sumo.netconvert import sumo_home


def generate_net(path: Path, *options: str) -> str:
    """Write a net with netgenerate's options, such as ``--grid`` for 5 × 5 junctions 100 m apart; return its text."""
    command = [sumo_home() / "bin/netgenerate", *options, "--output-file", path]
    subprocess.run(command, check=True, capture_output=True, env={"SUMO_HOME": str(sumo_home())})
    return path.read_text(encoding="utf-8")
