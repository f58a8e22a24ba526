"""Maps that editors and converters have damaged open, or are refused in one line; see ``map_mutations.py``."""

from pathlib import Path

import pytest
from map_mutations import SUFFIXES, build_everything, mutated, sample

# Coordinates far out of range overflow; what counts is what is built from them.
pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")
each_form = pytest.mark.parametrize("suffix", SUFFIXES)


def open_mutations(suffix: str, seeds: range, folder: Path) -> int:
    """Build mutations of the sample of a form; return how many open."""
    text, opened = sample(suffix), 0
    for seed in seeds:
        path = folder / f"{seed}{suffix}"
        path.write_bytes(mutated(text, seed))
        opened += build_everything(path, folder / "cache")
    return opened


@each_form
def test_damaged_maps_open_or_are_refused(tmp_path: Path, suffix: str) -> None:
    assert open_mutations(suffix, range(1, 3), tmp_path) >= 1


@pytest.mark.slow
@each_form
def test_most_of_many_damaged_maps_open(tmp_path: Path, suffix: str) -> None:
    assert open_mutations(suffix, range(100, 160), tmp_path) >= 48
