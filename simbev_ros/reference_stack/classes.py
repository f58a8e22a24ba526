"""Sizes of what is on the road, from ``classes.yaml``: the stack's only knowledge beforehand."""

from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

import numpy as np
import yaml

from simbev_ros.reference_stack.arrays import Booleans, Bytes, Floats

PEDESTRIAN = 5


@dataclass(frozen=True)
class Kinds:
    """K kinds of object; several may be of one class.

    Attributes:
        class_name: (K,) as /world/legend has it.
        class_number: (K,) as /world/legend has it.
        size_m: (K, 3) usual length, width, height of the box.
        sigma_m: (K, 3) their standard deviations.
        seen_m: (K, 3) the size with what a sensor cannot tell from it, its rider.
        fastest_mps: (K,) usual top speed.
        rarity: (K,) cost of believing in one.
        clutter: (K,) how many other things look like one that stands still, for each that is one.
    """

    class_name: tuple[str, ...]
    class_number: Bytes
    size_m: Floats
    sigma_m: Floats
    seen_m: Floats
    fastest_mps: Floats
    rarity: Floats
    clutter: Floats

    @property
    def is_person(self) -> Booleans:
        """(K,) whether it turns on the spot, and its points lie within its box rather than on it."""
        is_person: Booleans = self.class_number == PEDESTRIAN
        return is_person


@lru_cache(maxsize=1)
def load_kinds() -> Kinds:
    """Read the file."""
    rows = yaml.safe_load(files(__package__).joinpath("classes.yaml").read_text(encoding="utf-8"))
    sides = np.array([[row["length_m"], row["width_m"], row["height_m"]] for row in rows], np.float64)
    seen_m = sides[..., 0].copy()
    seen_m[:, 2] = [row.get("seen_height_m", row["height_m"][0]) for row in rows]
    return Kinds(
        class_name=tuple(row["class"] for row in rows),
        class_number=np.array([row["number"] for row in rows], np.uint8),
        size_m=sides[..., 0],
        sigma_m=sides[..., 1],
        seen_m=seen_m,
        fastest_mps=np.array([row["fastest_mps"] for row in rows], np.float64),
        rarity=np.array([row.get("rarity", 0.0) for row in rows], np.float64),
        clutter=np.array([row["clutter"] for row in rows], np.float64),
    )
