"""Every BEV class agrees with vertical rays through the meshes, 8 × 8 per cell, on frames of towns.

A cell has a class if the sample at its center lies below or above the class's mesh on the ego's level; the annotator
uses the same rule. The majority rule, by which half of a cell must be covered, differs at borders only.
"""

import numpy as np
import pytest
from bev_towns import Town, ego_states, load_town
from bev_truth import Truth

from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.semantics import BEV_CLASSES

GRIDS = (BevGrid(120, 120, 0.4), BevGrid(96, 160, 0.5), BevGrid(200, 120, 0.25), BevGrid(250, 200, 0.1))
SMALL = (BevGrid(80, 60, 0.5),) * 4
MANY = (BevGrid(360, 360, 0.4), *GRIDS[1:], *GRIDS, GRIDS[0])
LEAST_IOU = 0.995
ALWAYS = {"road", "hazard", "road_line", "car", "rider"}


class Tally:
    """Number of cells in the intersection and in the union, by class."""

    def __init__(self) -> None:
        self.both, self.either = dict.fromkeys(BEV_CLASSES, 0), dict.fromkeys(BEV_CLASSES, 0)

    def add(self, name: str, found: np.ndarray, truth: np.ndarray) -> None:
        self.both[name] += int((found & truth).sum())
        self.either[name] += int((found | truth).sum())

    def iou(self) -> dict[str, float]:
        return {name: self.both[name] / cells for name, cells in self.either.items() if cells}


def tallies(town: Town, grids: tuple[BevGrid, ...]) -> tuple[Tally, Tally, list[bool]]:
    """Tallies by cell centers and by cell majority, and whether roads had to be separated in each frame."""
    centers, halves, told_apart = Tally(), Tally(), []
    for grid, state in zip(grids, ego_states(town, len(grids), seed=len(grids)), strict=True):
        found, truth = town.labels(state, grid), Truth(town, state, grid)
        told_apart.append(truth.told_apart)
        for name, at_center, by_half in truth.samples():
            centers.add(name, found[name], at_center)
            if by_half is not None:
                halves.add(name, found[name], by_half)
    return centers, halves, told_apart


@pytest.mark.parametrize(
    ("name", "near_m", "grids"),
    [
        ("Blocks", None, SMALL),
        *(
            pytest.param(name, None, MANY[:8], marks=pytest.mark.slow)
            for name in ("Town01", "Town03", "Town07", "Town10HD")
        ),
        pytest.param("Town04", (0.0, 0.0), MANY, marks=pytest.mark.slow),
        pytest.param("Town05", (-10.0, 0.0), MANY, marks=pytest.mark.slow),
    ],
)
def test_every_class_of_a_town(name: str, near_m: tuple[float, float] | None, grids: tuple[BevGrid, ...]) -> None:
    centers, halves, told_apart = tallies(load_town(name, near_m), grids)
    print(name, {each: f"{iou:.4f} ({centers.either[each]} cells)" for each, iou in centers.iou().items()})
    print("by halves", {each: f"{iou:.3f}" for each, iou in halves.iou().items()})
    assert min(centers.iou().values()) >= LEAST_IOU
    assert set(centers.iou()) >= ALWAYS
    assert sum(told_apart) >= (3 if near_m else 0)
