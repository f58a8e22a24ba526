"""Fuzzes one target in this process with atheris: arguments are its name and libFuzzer's options and folders."""

import sys
import warnings
from random import Random

import atheris

warnings.simplefilter("ignore")
with atheris.instrument_imports(include=["simbev_ros", "mcap"]):
    from targets import TARGETS


def main() -> None:
    """Fuzz until time is over or something is found; then the process ends."""
    target = TARGETS[sys.argv[1]]

    def mutate(data: bytes, max_size: int, seed: int) -> bytes:
        rng = Random(seed)
        mutated = atheris.Mutate(data, max_size) if rng.randrange(2) else target.mutate(data, rng)
        return bytes(mutated[:max_size])

    atheris.Setup([sys.argv[0], *sys.argv[2:]], target.run, custom_mutator=mutate)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
