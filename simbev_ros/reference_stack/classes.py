"""Loads typical sizes and speeds of road users from ``classes.yaml``, the stack's only prior knowledge."""

from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

import numpy as np
import yaml

from simbev_ros.reference_stack.arrays import Booleans, Bytes, Floats

PEDESTRIAN = 5


@dataclass(frozen=True)
class Kinds:
    """K kinds of objects; several kinds may belong to one class.

    Attributes:
        class_name: (K,) name of the class, as in /world/legend.
        class_number: (K,) number of the class, as in /world/legend.
        size_m: (K, 3) typical length, width, height of the box.
        sigma_m: (K, 3) standard deviations of the size.
        seen_m: (K, 3) size as a sensor sees it, including the rider.
        fastest_mps: (K,) typical top speed.
        rarity: (K,) cost of assuming this kind, in squared standard deviations.
        clutter: (K,) number of other things that look like a stationary object of this kind, per such object.
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
        """(K,) whether the kind turns on the spot and its points lie inside its box rather than on the surface."""
        is_person: Booleans = self.class_number == PEDESTRIAN
        return is_person


@lru_cache(maxsize=1)
def load_kinds() -> Kinds:
    """Read ``classes.yaml``."""
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
