"""Layout of a picture: tiles of fixed aspect, side by side and one above the other, all edges flush.

The width of a row whose tiles keep their aspects is a linear function of its height, and so is that of a column: any
nesting of them has exactly one height for a given width.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, assert_never

LabelPlace = Literal["off", "panel", "cameras"]
"""Where labels are drawn: nowhere; over a second picture of the main camera, and from above; over all cameras too."""


class Box(NamedTuple):
    """A rectangle, pixels."""

    left: int
    top: int
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class Tile:
    """One picture, ``aspect`` being its width over its height."""

    key: str
    aspect: float


@dataclass(frozen=True, slots=True)
class Row:
    """Blocks of one height, from left to right; at least one."""

    blocks: Sequence["Block"]


@dataclass(frozen=True, slots=True)
class Column:
    """Blocks of one width, from top to bottom; at least one."""

    blocks: Sequence["Block"]


Block = Tile | Row | Column


def place_in_width(block: Block, left: int, top: int, width: int, gap_px: int) -> dict[str, Box]:
    """The boxes of a block's tiles, by key, when it is ``width`` pixels wide."""
    return dict(_place(block, left, top, width, gap_px))


def _place(block: Block, left: float, top: float, width: float, gap_px: int) -> Iterator[tuple[str, Box]]:
    slope, offset = _width_line(block, gap_px)
    height = (width - offset) / slope
    match block:
        case Tile():
            x, y = round(left), round(top)
            yield block.key, Box(x, y, round(left + width) - x, round(top + height) - y)
        case Row():
            for part in block.blocks:
                slope, offset = _width_line(part, gap_px)
                part_width = slope * height + offset
                yield from _place(part, left, top, part_width, gap_px)
                left += part_width + gap_px
        case Column():
            for part in block.blocks:
                slope, offset = _width_line(part, gap_px)
                yield from _place(part, left, top, width, gap_px)
                top += (width - offset) / slope + gap_px
        case _:
            assert_never(block)


def _width_line(block: Block, gap_px: int) -> tuple[float, float]:
    """Slope and offset of a block's width over its height."""
    if isinstance(block, Tile):
        return block.aspect, 0.0
    lines = [_width_line(part, gap_px) for part in block.blocks]
    gaps = gap_px * (len(lines) - 1)
    if isinstance(block, Row):
        return sum(slope for slope, _ in lines), sum(offset for _, offset in lines) + gaps
    total = 1 / sum(1 / slope for slope, _ in lines)
    return total, total * (sum(offset / slope for slope, offset in lines) - gaps)
