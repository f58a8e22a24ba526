"""Looks of people: tone of skin, colors of hair, second garment and leather, from the palettes in looks.yaml.

A look follows from the actor's id, color and blueprint, which the scene's seed determines. So it needs no column of its
own in tables and recordings, and people in recordings of any version have one.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from simbev_ros.config.base import Model
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import AnyArray, BoolArray, Int64Array, Table, UInt32Array
from simbev_ros.scene.blueprints import load_blueprints

_CHOICES = 256
"""Number of equally probable entries by which a palette is represented."""
_MIX = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
"""Constants of SplitMix64: Steele, Lea and Flood, "Fast Splittable Pseudorandom Number Generators", 2014."""


class Hair(Model):
    """A color of hair; looks.yaml explains the fields."""

    color: int
    share: float
    max_skin: int


class Looks(Model):
    """Palettes of looks.yaml, which explains them."""

    skin: tuple[int, ...]
    hair: tuple[Hair, ...]
    gray_hair: tuple[int, ...]
    leather: tuple[int, ...]


class _Choices(NamedTuple):
    """Palettes as arrays of ``_CHOICES`` colors: hair by tone, second garments by blueprint."""

    skin: UInt32Array
    hair: UInt32Array
    gray_hair: UInt32Array
    second: UInt32Array
    leather: UInt32Array
    is_old: BoolArray


@cache
def load_looks() -> Looks:
    """Load looks.yaml."""
    return Looks.model_validate(load_table("simbev_ros.scene", "looks.yaml"))


def looks_of(actors: Table) -> UInt32Array:
    """(N, 4) colors 0xRRGGBB of skin, hair, second garment and leather of (N,) ``ACTOR_DTYPE`` actors.

    They are 0 for all actors but people.
    """
    choices, blueprint = _choices(), actors["blueprint"].astype(np.int64)
    tone, *choice = _random_bytes(actors)
    tone %= len(choices.skin)
    hair = np.where(choices.is_old[blueprint], choices.gray_hair[choice[0]], choices.hair[tone, choice[0]])
    colors = [choices.skin[tone], hair, choices.second[blueprint, choice[1]], choices.leather[choice[2]]]
    is_person: BoolArray = np.isin(actors["tag"], [Tag.PEDESTRIAN, Tag.RIDER])
    return np.where(is_person[:, None], np.stack(colors, axis=-1), np.uint32(0))


def _random_bytes(actors: Table) -> list[Int64Array]:
    """Four random numbers per actor, the first one of 16 bits, the others below ``_CHOICES``."""
    key = actors["id"].astype(np.uint64) | actors["color"].astype(np.uint64) << np.uint64(32)
    key = (key ^ actors["blueprint"].astype(np.uint64) << np.uint64(48)) * _MIX[0]
    for shift, factor in ((30, _MIX[1]), (27, _MIX[2])):
        key = (key ^ key >> np.uint64(shift)) * factor
    key ^= key >> np.uint64(31)
    return [
        (key >> np.uint64(shift) & np.uint64(mask)).astype(np.int64)
        for shift, mask in ((48, 0xFFFF), (0, 255), (8, 255), (16, 255))
    ]


@cache
def _choices() -> _Choices:
    looks, blueprints = load_looks(), load_blueprints()
    hair = []
    for tone in range(1, len(looks.skin) + 1):
        usual = [each for each in looks.hair if tone <= each.max_skin]
        hair.append(_spread([each.color for each in usual], [each.share for each in usual]))
    return _Choices(
        skin=np.array(looks.skin, np.uint32),
        hair=np.stack(hair),
        gray_hair=_spread(looks.gray_hair),
        second=np.stack([_spread(each.colors2 or each.colors) for each in blueprints]),
        leather=_spread(looks.leather),
        is_old=np.array([each.old for each in blueprints]),
    )


def _spread(colors: AnyArray | tuple[int, ...] | list[int], shares: list[float] | None = None) -> UInt32Array:
    """(_CHOICES,) colors, each as often as its share says."""
    ends = np.cumsum(np.ones(len(colors)) if shares is None else shares)
    at = (np.arange(_CHOICES) + 0.5) / _CHOICES * ends[-1]
    return np.array(colors, np.uint32)[np.searchsorted(ends, at, side="right")]
