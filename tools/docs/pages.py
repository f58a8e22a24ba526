"""The generated pages: where each one lies, and the function that renders it."""

from collections.abc import Callable
from pathlib import Path

from tools.docs.commands import render_commands
from tools.docs.configuration import render_configuration
from tools.docs.interfaces import render_interfaces
from tools.docs.limits import render_limits
from tools.docs.openscenario import render_openscenario
from tools.docs.shapes import render_shapes
from tools.docs.tables import render_tables
from tools.docs.topics import render_topics

ROOT = Path(__file__).parents[2]
REFERENCE = ROOT / "docs" / "reference"

PAGES: dict[str, Callable[[], str]] = {
    "configuration.md": render_configuration,
    "topics.md": render_topics,
    "commands.md": render_commands,
    "box-columns.md": render_tables,
    "interfaces.md": render_interfaces,
    "limits-of-input.md": render_limits,
    "openscenario.md": render_openscenario,
    "shapes.md": render_shapes,
}
"""File name below docs/reference → function that renders the page."""


def write_pages() -> list[Path]:
    """Write all changed pages; return their paths."""
    changed = stale_pages()
    for path in changed:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(PAGES[path.name](), encoding="utf-8")
    return changed


def stale_pages() -> list[Path]:
    """Paths of the pages that differ from what the code says now."""
    return [
        REFERENCE / name
        for name, render in PAGES.items()
        if not (REFERENCE / name).is_file() or (REFERENCE / name).read_text(encoding="utf-8") != render()
    ]
