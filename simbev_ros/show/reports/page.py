"""Parts of HTML pages: sections, figures side by side, tables, key figures and legends."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape

from simbev_ros.show.reports.svg_drawing import Color, css


def key_figures(figures: Iterable[tuple[str, str]]) -> str:
    """HTML of the key figures at the head of a page: (value, label) pairs, as text."""
    shown = "".join(f"<div><b>{escape(value)}</b><span>{escape(what)}</span></div>" for value, what in figures)
    return f'<div class="key">{shown}</div>'


def section(title: str, body: str, note: str = "") -> str:
    """HTML of a section with a title and an optional note, as text; empty if ``body`` is."""
    said = f'<p class="lead">{escape(note)}</p>' if note else ""
    return f"<section><h2>{escape(title)}</h2>{said}{body}</section>" if body else ""


def sheet(kind: str, figures: Iterable[str]) -> str:
    """HTML of figures side by side; ``kind`` is the style class: ``wide``, ``small`` or ``pair``."""
    body = "".join(figures)
    return f'<div class="{kind}">{body}</div>' if body else ""


def table(heads: Sequence[str], rows: Iterable[str]) -> str:
    """HTML table with column heads, as text, and rows, each the HTML of its cells."""
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "".join(f"<tr>{cells}</tr>" for cells in rows)
    return f'<div class="table"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def words(name: str) -> str:
    """Name of a class as displayed text, with spaces."""
    return name.replace("_", " ")


def legend(series: Mapping[str, Color]) -> str:
    """HTML legend of names with their colors."""
    items = (f'<span><i style="background:{css(color)}"></i>{escape(name)}</span>' for name, color in series.items())
    return f'<p class="legend">{"".join(items)}</p>'
