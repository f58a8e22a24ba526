"""Builds self-contained HTML pages of sections, figures and tables, without scripts or other files."""

from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files

from simbev_ros import __version__

_STYLE_FILE = "page.css"
_POLICY = (
    '<meta http-equiv="Content-Security-Policy" '
    "content=\"default-src 'none'; style-src 'unsafe-inline'; img-src data:\">"
)
"""What browsers may load and run: no scripts, nothing from elsewhere."""


def page(title: str, head: str, body: str, *style_files: str) -> str:
    """A complete HTML page.

    Args:
        title: Title of the page, as text.
        head: HTML below the title.
        body: HTML of all sections.
        style_files: Names of style sheets in this package that are added to the common one.
    """
    folder = files("simbev_ros.show.reports")
    style = "".join(folder.joinpath(name).read_text(encoding="utf-8") for name in (_STYLE_FILE, *style_files))
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8">{_POLICY}<title>{escape(title)}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{style}</style></head><body><header><h1>{escape(title)}</h1>{head}</header>"
        f"<main>{body}</main><footer>simbev_ros {escape(__version__)}</footer></body></html>"
    )


def key_figures(figures: Iterable[tuple[str, str]]) -> str:
    """HTML of the key figures at the head of a page: (value, label) pairs, as text."""
    shown = "".join(f"<div><b>{escape(value)}</b><span>{escape(what)}</span></div>" for value, what in figures)
    return f'<div class="key">{shown}</div>'


def section(title: str, body: str, note: str = "") -> str:
    """HTML of a section with a title and an optional note, as text; empty if ``body`` is."""
    said = f'<p class="lead">{escape(note)}</p>' if note else ""
    return f"<section><h2>{escape(title)}</h2>{said}{body}</section>" if body else ""


def sheet(kind: str, figures: Iterable[str]) -> str:
    """HTML of figures beside each other; ``kind`` is the style class: ``wide``, ``small`` or ``pair``."""
    body = "".join(figures)
    return f'<div class="{kind}">{body}</div>' if body else ""


def table(heads: Sequence[str], rows: Iterable[str]) -> str:
    """HTML table with column heads, as text, and rows, each the HTML of its cells."""
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "".join(f"<tr>{cells}</tr>" for cells in rows)
    return f'<div class="table"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'
