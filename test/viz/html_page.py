"""Parses HTML reports in tests: checks that they are well-formed and self-contained; gives headings and tables."""

import re
from html.parser import HTMLParser
from xml.etree import ElementTree

_VOID = {"meta", "br"}


class Page(HTMLParser):
    """An HTML page, checked while it is parsed.

    Attributes:
        headings: Texts of all h2.
        tables: Cell texts of each table, by row.
        pictures: Addresses of all pictures.
        drawings: All SVG elements.
    """

    def __init__(self, text: str) -> None:
        super().__init__()
        self.headings: list[str] = []
        self.tables: list[list[list[str]]] = []
        self.pictures: list[str] = []
        self._open: list[str] = []
        self.feed(text)
        self.close()
        assert self._open == []
        assert all(re.match(r"data:image/(png|jpeg);base64,", address) for address in self.pictures)
        assert "://" not in re.sub(r"base64,[\w+/=]+", "", text) and "<script" not in text
        self.drawings = [ElementTree.fromstring(svg) for svg in re.findall(r"<svg .*?</svg>", text)]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.pictures += [value or "" for name, value in attrs if name in ("href", "src", "xlink:href")]
        if tag == "h2":
            self.headings.append("")
        elif tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("td", "th"):
            self.tables[-1][-1].append("")
        if tag not in _VOID:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self._open and self._open[-1] == "h2":
            self.headings[-1] += data
        elif self._open and self._open[-1] in ("td", "th"):
            self.tables[-1][-1][-1] += data

    def table(self, first_head: str, occurrence: int = 0) -> dict[str, list[str]]:
        """Rows by their heads, of the Nth table whose first column has a name."""
        rows = [each for each in self.tables if each[0][0] == first_head][occurrence]
        return {row[0]: row[1:] for row in rows}
