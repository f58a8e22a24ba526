"""Fuzzes one target in this process with atheris: arguments are its name and libFuzzer's options and folders."""

import os
import sys
import warnings
from itertools import count
from pathlib import Path
from random import Random

import atheris

warnings.simplefilter("ignore")
with atheris.instrument_imports(include=["simbev_ros", "mcap"]):
    from target import GROWN
    from targets import TARGETS

_MAX_GROWN_MIB = 1024
_STATM = Path("/proc/self/statm")


def main() -> None:
    """Fuzz until time is over, something is found, or the process has grown too large; then it ends."""
    target, executions = TARGETS[sys.argv[1]], count(1)

    def run(data: bytes) -> None:
        target.run(data)
        resident_mib = int(_STATM.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") >> 20
        executed = next(executions)
        if resident_mib > _MAX_GROWN_MIB:
            print(f"#{executed}\tGROWN rss: {resident_mib}Mb", file=sys.stderr, flush=True)
            os._exit(GROWN)

    def mutate(data: bytes, max_size: int, seed: int) -> bytes:
        rng = Random(seed)
        mutated = atheris.Mutate(data, max_size) if rng.randrange(2) else target.mutate(data, rng)
        return bytes(mutated[:max_size])

    atheris.Setup([sys.argv[0], *sys.argv[2:]], run, custom_mutator=mutate)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
