"""Draws marks on a sheet as SVG text for HTML pages, which format text and lines by their style sheet.

The lowest layer of reports' charts and pictures: text, lines, shapes, and embedded pictures, with colors and ticks.
"""

import base64
import io
import math
from dataclasses import dataclass, field
from html import escape

import numpy as np
from PIL import Image

from simbev_ros.foundation.types import AnyArray, UInt8Array

Color = tuple[int, int, int]
INK: Color = (47, 111, 143)
Size = tuple[float, float]

_TICKS = 5


@dataclass(slots=True)
class Drawing:
    """A sheet of a given size and the SVG marks on it, in painting order."""

    width: float
    height: float
    marks: list[str] = field(default_factory=list)

    def add(self, mark: str) -> None:
        """Add an SVG mark on top of the others."""
        self.marks.append(mark)

    def text(self, x: float, y: float, text: str, kind: str = "tick", anchor: str = "middle") -> None:
        """Add one line of text; ``kind`` is its class in the style sheet."""
        self.add(f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>')

    def line(self, x0: float, y0: float, x1: float, y1: float, kind: str = "grid") -> None:
        """Add a straight line; ``kind`` is its class in the style sheet."""
        self.add(f'<line class="{kind}" x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}"/>')

    def block(self, x: float, y: float, width: float, height: float, color: Color, title: str = "") -> None:
        """Add a filled rectangle; ``title`` is shown under the pointer."""
        box = f'x="{x:.2f}" y="{y:.2f}" width="{max(width, 0):.2f}" height="{max(height, 0):.2f}"'
        self.add(f'<rect {box} fill="{css(color)}"><title>{escape(title)}</title></rect>')

    def path(self, kind: str, data: str, title: str = "") -> None:
        """Add lines along SVG path data; ``kind`` is their class in the style sheet."""
        tooltip = f"<title>{escape(title)}</title>" if title else ""
        self.add(f'<path class="{kind}" d="{data}">{tooltip}</path>')

    def picture(self, x: float, y: float, size: Size, indices: AnyArray, ramp: AnyArray) -> None:
        """Add a picture of (H, W) uint8 indices into (256, 3) RGB or (256, 4) RGBA colors."""
        self.photo(x, y, size, _png(indices, ramp))

    def photo(self, x: float, y: float, size: Size, address: str) -> None:
        """Add a picture at an address, such as a result of ``jpeg``."""
        box = f'x="{x:.1f}" y="{y:.1f}" width="{size[0]:.1f}" height="{size[1]:.1f}"'
        self.add(f'<image {box} preserveAspectRatio="none" href="{address}"/>')

    def mark_ego(self, x: float, y: float) -> None:
        """Add the ego's mark, a small arrow that points up."""
        self.add(f'<path class="ego" d="M{x:.1f} {y - 7:.1f}l5 12l-5 -3l-5 3z"/>')

    def svg(self, label: str = "") -> str:
        """The whole sheet as SVG text; ``label`` is read aloud in its place."""
        box, said = f"0 0 {self.width:.0f} {self.height:.0f}", f' aria-label="{escape(label)}"' if label else ""
        return f'<svg viewBox="{box}" width="{self.width:.0f}" role="img"{said}>{"".join(self.marks)}</svg>'


def number(value: float) -> str:
    """A number as short text, about five characters, with a unit prefix (k, M, G) if it is large."""
    size = abs(value)
    for scale, unit in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if size >= max(scale, 1e4):
            return f"{value / scale:.3g} {unit}" if size < 1e3 * scale else f"{value / scale:,.0f} {unit}"
    return f"{value:,.0f}" if size >= 100 or float(value).is_integer() else f"{value:.3g}"


def css(color: Color) -> str:
    """A color in CSS notation, ``#rrggbb``."""
    red, green, blue = color
    return f"#{red:02x}{green:02x}{blue:02x}"


def ticks(low: float, high: float, min_step: float = 0.0) -> list[float]:
    """Round tick values between two limits, at least ``min_step`` apart."""
    rough = max((high - low) / _TICKS, min_step)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * factor for factor in (1, 2, 2.5, 5, 10) if power * factor >= rough * 0.999)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(index * step, 12) for index in range(first, last + 1)]


def jpeg(picture: UInt8Array, quality: int = 82) -> str:
    """A data URL that contains a (H, W, 3) uint8 RGB picture as JPEG."""
    return _address("jpeg", jpeg_bytes(picture, quality))


def jpeg_bytes(picture: UInt8Array, quality: int = 82) -> bytes:
    """A (H, W, 3) uint8 RGB picture as JPEG."""
    file = io.BytesIO()
    Image.fromarray(picture).save(file, "JPEG", quality=quality, optimize=True)
    return file.getvalue()


def _png(indices: AnyArray, ramp_colors: AnyArray) -> str:
    picture = Image.fromarray(np.ascontiguousarray(indices, np.uint8), "P")
    picture.putpalette(np.ascontiguousarray(ramp_colors[:, :3], np.uint8).tobytes())
    opacities = {"transparency": ramp_colors[:, 3].astype(np.uint8).tobytes()} if ramp_colors.shape[1] > 3 else {}
    file = io.BytesIO()
    picture.save(file, "PNG", optimize=True, **opacities)
    return _address("png", file.getvalue())


def _address(kind: str, data: bytes) -> str:
    return f"data:image/{kind};base64," + base64.b64encode(data).decode()
