"""Parses HTML pages in tests: checks that they are well-formed and fetch nothing; gives headings, tables and charts."""

import json
import re
from html.parser import HTMLParser
from typing import Any
from xml.etree import ElementTree

_VOID = {"meta", "br", "img", "input", "link"}


class Page(HTMLParser):
    """An HTML page, checked while it is parsed.

    Attributes:
        headings: Texts of all h2.
        tables: Cell texts of each table, by row.
        pictures: Addresses of all pictures.
        drawings: All SVG elements.
        links: Targets of all links.
        unlabeled: Pictures and videos without a text in their place.
        charts: Data of all charts and their labels.
        scripts: Addresses of scripts.

    Args:
        text: The page.
        is_single: Whether the page needs no other file.
    """

    def __init__(self, text: str, *, is_single: bool = False) -> None:
        super().__init__()
        self.headings: list[str] = []
        self.tables: list[list[list[str]]] = []
        self.pictures: list[str] = []
        self.links: list[str] = []
        self.unlabeled: list[str] = []
        self.charts: dict[str, Any] = {}
        self.scripts: list[str] = []
        self._open: list[str] = []
        self._label, self._is_data = "", False
        text = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
        self.feed(text)
        self.close()
        assert self._open == []
        assert "://" not in re.sub(r"base64,[\w+/=]+", "", text)
        if is_single:
            assert all(re.match(r"data:image/(png|jpeg);base64,", address) for address in self.pictures)
            assert self.scripts == []
        self.drawings = [ElementTree.fromstring(svg) for svg in re.findall(r"<svg .*?</svg>", text)]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        if tag == "a":
            self.links.append(given["href"])
        elif tag == "link":
            assert given == {"rel": "icon", "href": "data:,"}
        elif tag == "script":
            self.scripts += [given["src"]] if "src" in given else []
            self._is_data = given.get("type") == "application/json"
        else:
            self.pictures += [given[name] for name in ("href", "src", "poster", "xlink:href") if name in given]
        if tag in ("img", "video", "svg") and not given.get("alt", given.get("aria-label")):
            self.unlabeled.append(tag)
        self._label = given["aria-label"] if given.get("class") == "chart" else self._label
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
        if self._open and self._open[-1] == "script" and self._is_data:
            self.charts[self._label] = json.loads(data)
        elif self._open and self._open[-1] == "h2":
            self.headings[-1] += data
        elif set(self._open) & {"td", "th"}:
            self.tables[-1][-1][-1] += data

    def table(self, first_head: str, occurrence: int = 0) -> dict[str, list[str]]:
        """Rows by their heads, of the Nth table whose first column has a name."""
        rows = [each for each in self.tables if each[0][0] == first_head][occurrence]
        return {row[0]: row[1:] for row in rows}
