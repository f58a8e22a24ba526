"""Layout of a sheet of pictures: tiles of fixed aspect ratio in nested rows and columns, with all edges flush.

A tree of rows, columns and tiles and a width enter; one box in pixels for each tile leaves. The width of a row whose
tiles keep their aspect ratios is a linear function of its height, and the same holds for a column: any nesting of them
has exactly one height for a given width.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import assert_never

from simbev_ros.drawing.canvas import Box


@dataclass(frozen=True, slots=True)
class Tile:
    """A leaf of the layout: one picture.

    Attributes:
        key: Name under which ``place_in_width`` returns its box.
        aspect: Width over height.
    """

    key: str
    aspect: float


@dataclass(frozen=True, slots=True)
class Row:
    """At least one block, all of the same height, from left to right."""

    blocks: Sequence["Block"]


@dataclass(frozen=True, slots=True)
class Column:
    """At least one block, all of the same width, from top to bottom."""

    blocks: Sequence["Block"]


Block = Tile | Row | Column


def place_in_width(block: Block, left: int, top: int, width: int, gap_px: int) -> dict[str, Box]:
    """Lay out a block and return the box of each of its tiles, by key.

    Args:
        block: The tree of rows, columns and tiles.
        left: Left edge of the block, pixels.
        top: Top edge of the block, pixels.
        width: Width of the block, pixels; its height follows.
        gap_px: Gap between neighboring blocks, pixels.
    """
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
    """Slope and offset of a block's width as a linear function of its height."""
    if isinstance(block, Tile):
        return block.aspect, 0.0
    lines = [_width_line(part, gap_px) for part in block.blocks]
    gaps = gap_px * (len(lines) - 1)
    if isinstance(block, Row):
        return sum(slope for slope, _ in lines), sum(offset for _, offset in lines) + gaps
    total = 1 / sum(1 / slope for slope, _ in lines)
    return total, total * (sum(offset / slope for slope, offset in lines) - gaps)
