"""Layout of a picture: tiles of fixed aspect, side by side and one above the other, all edges flush.

The height of a row whose tiles keep their aspects is a linear function of its width, and so is that of a column, so any
nesting of them has exactly one height for a given width.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol


class Box(NamedTuple):
    """A rectangle, pixels."""

    left: int
    top: int
    width: int
    height: int


class Block(Protocol):
    """Part of a layout: its width is ``slope`` × its height + ``offset(gap_px)``."""

    @property
    def slope(self) -> float:
        """Growth of the width with the height."""

    def offset(self, gap_px: float) -> float:
        """Width at height 0, pixels."""

    def place(self, left: float, top: float, height: float, gap_px: float) -> Iterator[tuple[str, Box]]:
        """The boxes of the tiles in it, by key."""


@dataclass(frozen=True, slots=True)
class Tile:
    """One picture.

    Attributes:
        aspect: Width over height.
    """

    key: str
    aspect: float

    @property
    def slope(self) -> float:
        return self.aspect

    def offset(self, gap_px: float) -> float:
        return 0.0

    def place(self, left: float, top: float, height: float, gap_px: float) -> Iterator[tuple[str, Box]]:
        right, bottom = left + self.aspect * height, top + height
        x, y = round(left), round(top)
        yield self.key, Box(x, y, round(right) - x, round(bottom) - y)


@dataclass(frozen=True, slots=True)
class Row:
    """Blocks of one height, from left to right."""

    blocks: Sequence[Block]

    @property
    def slope(self) -> float:
        return sum(block.slope for block in self.blocks)

    def offset(self, gap_px: float) -> float:
        return sum(block.offset(gap_px) for block in self.blocks) + gap_px * (len(self.blocks) - 1)

    def place(self, left: float, top: float, height: float, gap_px: float) -> Iterator[tuple[str, Box]]:
        for block in self.blocks:
            yield from block.place(left, top, height, gap_px)
            left += block.slope * height + block.offset(gap_px) + gap_px


@dataclass(frozen=True, slots=True)
class Column:
    """Blocks of one width, from top to bottom."""

    blocks: Sequence[Block]

    @property
    def slope(self) -> float:
        return 1 / sum(1 / block.slope for block in self.blocks)

    def offset(self, gap_px: float) -> float:
        spare = sum(block.offset(gap_px) / block.slope for block in self.blocks) - gap_px * (len(self.blocks) - 1)
        return self.slope * spare

    def place(self, left: float, top: float, height: float, gap_px: float) -> Iterator[tuple[str, Box]]:
        width = self.slope * height + self.offset(gap_px)
        for block in self.blocks:
            part = (width - block.offset(gap_px)) / block.slope
            yield from block.place(left, top, part, gap_px)
            top += part + gap_px


def place_in_width(block: Block, left: int, top: int, width: int, gap_px: int) -> dict[str, Box]:
    """The boxes of a block's tiles, by key, when it is ``width`` pixels wide."""
    height = (width - block.offset(gap_px)) / block.slope
    return dict(block.place(left, top, height, gap_px))
