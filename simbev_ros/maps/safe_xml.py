"""Parses XML files supplied by users: limited in size and depth, without entities, each element with its line number.

Built on the standard library's expat, configured to refuse what only attacks need. A package such as defusedxml would
add nothing but the refusal of entities, and has neither line numbers nor limits.
"""

import stat
from pathlib import Path
from typing import NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from simbev_ros.errors import InputError
from simbev_ros.limits import MAX_MAP_BYTES, MAX_XML_DEPTH, MAX_XML_ELEMENTS

_CHUNK_BYTES = 1 << 20


class LinedElement(Element):
    """An element with the 1-based number of the line in which it starts."""

    __slots__ = ("line",)
    line: int


def parse(path: Path, root_tag: str) -> Element:
    """Parse an XML file and return its root.

    Args:
        path: A regular file.
        root_tag: Required tag of the root element.

    Returns:
        The root; it and all its descendants are ``LinedElement``s, see ``place_of``.

    Raises:
        InputError: The file cannot be read, is too large, is not well-formed, has a document type declaration, is too
            deeply nested, or has another root.
    """
    check_readable(path, MAX_MAP_BYTES)
    reader = _Reader(path, root_tag)
    try:
        with path.open("rb") as stream:
            while chunk := stream.read(_CHUNK_BYTES):
                reader.parser.Parse(chunk, False)
        reader.parser.Parse(b"", True)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        hint = "; the file ends too early" if error.code in _TRUNCATED_CODES else ""
        reader.refuse(f"not valid XML: {reason}{hint}", error.lineno, error.offset + 1)
    except (LookupError, ValueError) as error:
        reader.refuse(f"its encoding is unknown: {error}", 1)
    return reader.close()


def place_of(path: Path, element: Element) -> str:
    """``file:line`` of an element, for error messages."""
    return f"{path}:{element.line}" if isinstance(element, LinedElement) else str(path)


_TRUNCATED_CODES = (
    expat.errors.codes[expat.errors.XML_ERROR_NO_ELEMENTS],
    expat.errors.codes[expat.errors.XML_ERROR_UNCLOSED_TOKEN],
    expat.errors.codes[expat.errors.XML_ERROR_UNCLOSED_CDATA_SECTION],
    expat.errors.codes[expat.errors.XML_ERROR_PARTIAL_CHAR],
)


def check_readable(path: Path, max_bytes: int = MAX_MAP_BYTES) -> None:
    """Raise InputError unless a path is a regular, non-empty file of at most ``max_bytes``; reads metadata only."""
    try:
        status = path.stat()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    if not stat.S_ISREG(status.st_mode):
        raise InputError(f"{path}: is not a file")
    if status.st_size == 0:
        raise InputError(f"{path}: is empty")
    if status.st_size > max_bytes:
        raise InputError(
            f"{path}: has {status.st_size / 2**20:.0f} MiB; at most {max_bytes / 2**20:.0f} MiB are read. "
            "Extract the part that you need"
        )


class _Reader:
    """An expat parser that fills an element tree."""

    def __init__(self, path: Path, root_tag: str) -> None:
        self.builder = TreeBuilder(element_factory=LinedElement)
        self.parser = parser = expat.ParserCreate()
        self._path, self._root_tag = path, root_tag
        self._depth = self._elements = 0
        parser.buffer_text = True
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self.builder.data
        parser.StartDoctypeDeclHandler = self._doctype

    def refuse(self, problem: str, line: int, column: int | None = None) -> NoReturn:
        """Raise InputError with the problem and its position in the file."""
        location = f"{self._path}:{line}" if column is None else f"{self._path}:{line}:{column}"
        raise InputError(f"{location}: {problem}")

    def close(self) -> Element:
        """Return the root and remove the handlers, which would keep the tree alive through a reference cycle."""
        parser, root = self.parser, self.builder.close()
        parser.StartElementHandler = parser.EndElementHandler = parser.CharacterDataHandler = None
        parser.StartDoctypeDeclHandler = None
        return root

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self.parser.CurrentLineNumber
        if self._elements == 0 and tag != self._root_tag:
            self.refuse(f"the root element must be <{self._root_tag}>, not <{tag:.40}>", line)
        self._depth += 1
        self._elements += 1
        if self._depth > MAX_XML_DEPTH:
            self.refuse(f"elements are nested more than {MAX_XML_DEPTH} deep", line)
        if self._elements > MAX_XML_ELEMENTS:
            self.refuse(f"has more than {MAX_XML_ELEMENTS} elements", line)
        element: LinedElement = self.builder.start(tag, attributes)  # type: ignore[assignment]
        element.line = line

    def _end(self, tag: str) -> None:
        self._depth -= 1
        self.builder.end(tag)

    def _doctype(self, *_: object) -> None:
        self.refuse("document type declarations (<!DOCTYPE>) are not accepted", self.parser.CurrentLineNumber)
