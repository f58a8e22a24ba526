"""Looks of people: tone of skin, colors of hair, second garment and leather, drawn from the palettes in looks.yaml."""

from functools import cache
from typing import NamedTuple

import numpy as np

from simbev_ros.config.base import Model
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Table, UInt32Array
from simbev_ros.scene.blueprints import Blueprint, load_blueprints

COLUMNS = ("skin", "hair", "color2", "leather")
"""Columns of the actors table with a person's look."""

_UNKNOWN_SKIN = 5
"""Tone of a person in a recording of a version that did not draw it."""


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


class Look(NamedTuple):
    """A person's look, in the order of ``COLUMNS``; the tone of skin counts from 1, colors are 0xRRGGBB."""

    skin: int
    hair: int
    color2: int
    leather: int


@cache
def load_looks() -> Looks:
    """Load looks.yaml."""
    return Looks.model_validate(load_table("simbev_ros.scene", "looks.yaml"))


@cache
def skin_colors() -> UInt32Array:
    """(11,) colors 0xRRGGBB by the column ``skin``; index 0 is for people of whom it is not known."""
    tones = load_looks().skin
    return np.array([tones[_UNKNOWN_SKIN - 1], *tones], np.uint32)


def draw_look(blueprint: Blueprint, rng: np.random.Generator) -> Look:
    """Draw the look of a person with a blueprint."""
    looks = load_looks()
    tone = int(rng.integers(1, len(looks.skin), endpoint=True))
    hair = [each for each in looks.hair if tone <= each.max_skin]
    cumulative = np.cumsum([each.share for each in hair])
    color = hair[int(np.searchsorted(cumulative, rng.random() * cumulative[-1], side="right"))].color
    second = blueprint.colors2 or blueprint.colors
    return Look(
        skin=tone,
        hair=_pick(looks.gray_hair, rng) if blueprint.old else color,
        color2=_pick(second, rng),
        leather=_pick(looks.leather, rng),
    )


def fill_looks(rows: Table, seed: int) -> None:
    """Draw the looks of the people among (N,) ``ACTOR_DTYPE`` rows in place; each depends on its id and the seed."""
    for index in np.flatnonzero(np.isin(rows["tag"], [Tag.PEDESTRIAN, Tag.RIDER])).tolist():
        blueprint = load_blueprints()[rows["blueprint"][index]]
        look = draw_look(blueprint, stream(seed, f"looks.{rows['id'][index]}"))
        for name, value in zip(COLUMNS, look, strict=True):
            rows[name][index] = value


def _pick(colors: tuple[int, ...], rng: np.random.Generator) -> int:
    return colors[int(rng.integers(len(colors)))]
