"""Builds HTML pages with the project's own scripts, which load nothing from elsewhere.

Sections of HTML enter; a complete page leaves. Style sheets and scripts of this package are part of the page. Its
policy allows those scripts by their hashes and no others, so that no text from a bag can become one.
"""

import base64
import hashlib
import json
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files
from typing import Any

from simbev_ros import __version__

_STYLE = "page.css"


def web_page(
    title: str, head: str, body: str, scripts: Sequence[str], plotly: str = "", *, is_single: bool = False
) -> str:
    """A complete HTML page.

    Args:
        title: Title of the page, as text.
        head: HTML above and below the title.
        body: HTML of all sections.
        scripts: Names of this package's scripts that the page runs.
        plotly: Address of Plotly's script, relative to the page; empty: the page has no charts, or holds the script.
        is_single: Whether the page holds Plotly's script, so that it is a single file.
    """
    codes = [*([plotly_script()] if is_single else []), *map(_text, scripts)]
    hashes = (base64.b64encode(hashlib.sha256(code.encode()).digest()).decode() for code in codes)
    sources = " ".join([*(f"'sha256-{each}'" for each in hashes), *(["'self'", "file:"] if plotly else [])])
    policy = (
        f"default-src 'none'; script-src {sources}; style-src 'unsafe-inline'; "
        "img-src data: 'self' file:; media-src 'self' file:; form-action 'none'; base-uri 'none'"
    )
    library = f'<script src="{escape(plotly)}"></script>' if plotly else ""
    own = "".join(f"<script>{code}</script>" for code in codes)
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}"><title>{escape(title)}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">'
        f'<style>{_text(_STYLE)}</style></head><body><a class="skip" href="#content">Skip to the content</a>'
        f'<header><h1>{escape(title)}</h1>{head}</header><main id="content">{body}</main>'
        f"<footer>simbev_ros {escape(__version__)}</footer>{library}{own}</body></html>\n"
    )


def json_block(value: Any) -> str:
    """HTML of data for a script. No text in it can end the block."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return f'<script type="application/json">{text.replace("<", chr(92) + "u003c")}</script>'


def plotly_script() -> str:
    """Plotly's script, from its wheel."""
    from plotly.offline import get_plotlyjs

    return str(get_plotlyjs())


def facts(pairs: Iterable[tuple[str, str]], kind: str = "") -> str:
    """HTML list of facts: (name, value) pairs, as text; with the style class ``rows`` each in a line of its own."""
    rows = "".join(f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in pairs)
    return f'<dl class="{f"facts {kind}".strip()}">{rows}</dl>'


def _text(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")
