"""Maps that editors and converters have damaged open, or are refused in one line; see ``map_mutations.py``."""

from pathlib import Path

import pytest
from map_mutations import build_everything, mutated
from map_samples import SUFFIXES, sample

# Coordinates far out of range overflow; what counts is what is built from them.
pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")


@pytest.mark.slow
@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(("seeds", "min_opened"), [(range(1, 2), 1), (range(100, 160), 48)])
def test_most_damaged_maps_open_and_the_others_are_refused(
    tmp_path: Path, suffix: str, seeds: range, min_opened: int
) -> None:
    text, opened = sample(suffix), 0
    for seed in seeds:
        path = tmp_path / f"{seed}{suffix}"
        path.write_bytes(mutated(text, seed))
        opened += build_everything(path, tmp_path / "cache")
    assert opened >= min_opened
