"""Fuzzes the readers of foreign bytes with coverage guidance, one after the other; ``./simbev fuzz`` calls it.

Each target runs in a process of its own, as libFuzzer ends its process at the first find. Inputs that reach new code,
and finds, go to ``out/fuzz/<target>``; nothing in the tree changes.
"""

import argparse
import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from simbev_ros.foundation.files.limits import MAX_UNPACKED_VARIABLE

ROOT = Path(__file__).parents[2]
OUT = ROOT / "out" / "fuzz"
SUPPORT = ROOT / "test" / "support"
"""Folder of modules that targets and tests share."""
_LIMIT_MIB = 64
_MAX_MEMORY_MIB = 2048
_TIMEOUT_S = 30


class Result(NamedTuple):
    """What a run of a target came to: inputs that were read, covered edges, and the file of its find, if any."""

    executions: int
    coverage: int
    find: Path | None


def main() -> None:
    """Run the targets and print a table of results; exit with 1 after a find."""
    sys.path.append(str(SUPPORT))
    from targets import TARGETS

    parser = argparse.ArgumentParser(prog="simbev fuzz", description="Fuzz the readers of foreign files and messages.")
    parser.add_argument("target", nargs="*", help=f"default: all; {', '.join(TARGETS)}")
    parser.add_argument("--seconds", type=int, default=60, help="for each target, from 1; default: %(default)s")
    options = parser.parse_args()
    if unknown := [name for name in options.target if name not in TARGETS]:
        parser.error(f"there is no target {unknown[0]!r}; allowed: {', '.join(TARGETS)}")
    if options.seconds < 1:
        parser.error(f"--seconds: is {options.seconds}; allowed: 1 and more")
    if find_spec("atheris") is None:
        version = ".".join(map(str, sys.version_info[:2]))
        sys.exit(f"simbev: atheris, which ./simbev fuzz needs, has no package for Python {version} on this machine")
    print(f"{'target':<18}{'executions':>12}{'coverage':>10}  finds")
    results = []
    for name in options.target or TARGETS:
        results.append(result := run_target(name, TARGETS[name].folder, options.seconds))
        print(f"{name:<18}{result.executions:>12,}{result.coverage:>10,}  {result.find or '-'}", flush=True)
    sys.exit(any(result.find for result in results))


def run_target(name: str, corpus: Path, seconds: int) -> Result:
    """Fuzz a target for a while, or until its first find."""
    found = OUT / name / "corpus"
    found.mkdir(parents=True, exist_ok=True)
    before = set(OUT.joinpath(name).glob("*-*"))
    options = [
        *(f"-max_total_time={seconds}", f"-timeout={_TIMEOUT_S}", f"-rss_limit_mb={_MAX_MEMORY_MIB}"),
        *("-print_final_stats=1", f"-artifact_prefix={OUT / name}/"),
    ]
    command = [sys.executable, str(Path(__file__).parent / "fuzz_target.py"), name, *options, str(found), str(corpus)]
    modules = os.pathsep.join([str(SUPPORT), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = {**os.environ, MAX_UNPACKED_VARIABLE: str(_LIMIT_MIB), "PYTHONPATH": modules}
    log = OUT / name / "log"
    with log.open("wb") as stream:
        code = subprocess.run(command, stdout=stream, stderr=stream, env=environment, check=False).returncode
    text = log.read_text(errors="replace")
    counts = [int(count) for count in re.findall(r"(?:^#|stat::number_of_executed_units: )(\d+)", text, re.MULTILINE)]
    edges = [int(count) for count in re.findall(r"cov: (\d+)", text)]
    finds = sorted(set(OUT.joinpath(name).glob("*-*")) - before)
    find = finds[0] if finds else log if code else None
    return Result(max(counts, default=0), max(edges, default=0), find)


if __name__ == "__main__":
    main()
