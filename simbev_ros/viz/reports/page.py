"""Pages of HTML that need nothing beside themselves: no scripts, no other files."""

from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files

from simbev_ros import __version__

_STYLE_FILE = "page.css"


def page(title: str, head: str, body: str, *style_files: str) -> str:
    """The whole page.

    Args:
        title: Its name, as text.
        head: HTML below the title.
        body: HTML of all sections.
        style_files: Of this package, on top of what all pages look like.
    """
    folder = files("simbev_ros.viz.reports")
    style = "".join(folder.joinpath(name).read_text(encoding="utf-8") for name in (_STYLE_FILE, *style_files))
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{style}</style></head><body><header><h1>{escape(title)}</h1>{head}</header>"
        f"<main>{body}</main><footer>simbev_ros {escape(__version__)}</footer></body></html>"
    )


def key_figures(figures: Iterable[tuple[str, str]]) -> str:
    """What is to be seen first: values, and what they are."""
    shown = "".join(f"<div><b>{escape(value)}</b><span>{escape(what)}</span></div>" for value, what in figures)
    return f'<div class="key">{shown}</div>'


def section(title: str, body: str, note: str = "") -> str:
    """Nothing if there is nothing in it."""
    said = f'<p class="lead">{escape(note)}</p>' if note else ""
    return f"<section><h2>{escape(title)}</h2>{said}{body}</section>" if body else ""


def sheet(kind: str, figures: Iterable[str]) -> str:
    """Wide or small figures beside each other."""
    body = "".join(figures)
    return f'<div class="{kind}">{body}</div>' if body else ""


def table(heads: Sequence[str], rows: Iterable[str]) -> str:
    """Heads as text, above rows of cells in HTML."""
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "".join(f"<tr>{cells}</tr>" for cells in rows)
    return f'<div class="table"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'
