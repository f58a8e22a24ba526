"""Fuzzes the readers of foreign bytes with coverage guidance; ``./simbev fuzz`` calls it.

Each run of a target has a process of its own, as libFuzzer ends its process at the first find; one that has grown too
large is replaced. Inputs that reach new code, and finds, go to ``out/fuzz/<target>``; nothing in the tree changes.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from target import GROWN, Target

from simbev_ros.foundation.files.limits import MAX_UNPACKED_VARIABLE

ROOT = Path(__file__).parents[2]
OUT = ROOT / "out" / "fuzz"
SUPPORT = ROOT / "test" / "support"
"""Folder of modules that targets and tests share."""
_LIMIT_MIB = 64
_MAX_MEMORY_MIB = 2048
_TIMEOUT_S = 30


class Result(NamedTuple):
    """What a run came to: inputs that were read, covered edges, memory, processes beyond the first, and its find."""

    executions: int
    coverage: int
    peak_mib: int
    restarts: int
    find: Path | None


def main() -> None:
    """Run the targets and print a table of results; exit with 1 after a find."""
    sys.path.append(str(SUPPORT))
    from targets import TARGETS

    parser = argparse.ArgumentParser(prog="simbev fuzz", description="Fuzz the readers of foreign files and messages.")
    parser.add_argument("target", nargs="*", help=f"default: all; {', '.join(TARGETS)}")
    parser.add_argument("--seconds", type=int, default=60, help="for each target, from 1; default: %(default)s")
    parser.add_argument("--seeds", type=int, default=1, help="runs of each target, from 1; default: %(default)s")
    parser.add_argument("--processes", type=int, default=1, help="runs at a time, from 1; default: %(default)s")
    options = parser.parse_args()
    if unknown := [name for name in options.target if name not in TARGETS]:
        parser.error(f"there is no target {unknown[0]!r}; allowed: {', '.join(TARGETS)}")
    for name in ("seconds", "seeds", "processes"):
        if (value := getattr(options, name)) < 1:
            parser.error(f"--{name}: is {value}; allowed: 1 and more")
    if find_spec("atheris") is None:
        version = ".".join(map(str, sys.version_info[:2]))
        sys.exit(f"simbev: atheris, which ./simbev fuzz needs, has no package for Python {version} on this machine")
    print(f"{'target':<18}{'executions':>12}{'coverage':>10}{'peak MiB':>10}{'restarts':>10}  finds")
    has_found = False
    with ThreadPoolExecutor(options.processes) as pool:
        runs = {
            name: [pool.submit(run_target, TARGETS[name], run, options.seconds) for run in range(options.seeds)]
            for name in options.target or TARGETS
        }
        try:
            for name, started in runs.items():
                results = [run.result() for run in started]
                executions, coverage, peak_mib, restarts, found = zip(*results, strict=True)
                finds = sorted({str(find) for find in found if find})
                has_found |= bool(finds)
                numbers = f"{sum(executions):>12,}{max(coverage):>10,}{max(peak_mib):>10,}{sum(restarts):>10,}"
                print(f"{name:<18}{numbers}  {', '.join(finds) or '-'}", flush=True)
        finally:  # after an interrupt, no more of them start
            pool.shutdown(cancel_futures=True)
    sys.exit(has_found)


def run_target(target: Target, run: int, seconds: int) -> Result:
    """Fuzz a target for a while, or until its first find; runs of it at the same time share what they reach."""
    out = OUT / target.name
    reached, log = out / "corpus", out / f"log{run}"
    reached.mkdir(parents=True, exist_ok=True)
    before, code, restarts, end_s = set(out.glob("*-*")), GROWN, -1, time.monotonic() + seconds
    with log.open("wb") as stream, tempfile.TemporaryDirectory(prefix="simbev-fuzz-") as folder:
        modules = os.pathsep.join([str(SUPPORT), *filter(None, [os.environ.get("PYTHONPATH")])])
        changed = {MAX_UNPACKED_VARIABLE: str(_LIMIT_MIB), "PYTHONPATH": modules, "TMPDIR": folder}
        environment = {**os.environ, **changed}
        while code == GROWN and (left_s := round(end_s - time.monotonic())) > 0:
            options = [
                *(f"-max_total_time={left_s}", f"-timeout={_TIMEOUT_S}", f"-rss_limit_mb={_MAX_MEMORY_MIB}"),
                *("-print_final_stats=1", f"-artifact_prefix={out}/"),
            ]
            program = str(Path(__file__).with_name("fuzz_target.py"))
            command = [sys.executable, program, target.name, *options, str(reached), str(target.folder)]
            code = subprocess.run(command, stdout=stream, stderr=stream, env=environment, check=False).returncode
            restarts += 1
    text = log.read_text(errors="replace")
    executions = sum(_largest(r"^#(\d+)", session) for session in text.split("INFO: Seed:"))
    finds = sorted(set(out.glob("*-*")) - before)
    find = finds[0] if finds else log if code not in (0, GROWN) else None
    return Result(executions, _largest(r"cov: (\d+)", text), _largest(r"rss: (\d+)Mb", text), restarts, find)


def _largest(pattern: str, text: str) -> int:
    """The largest number that a pattern finds; 0 without one."""
    return max(map(int, re.findall(pattern, text, re.MULTILINE)), default=0)


if __name__ == "__main__":
    main()
