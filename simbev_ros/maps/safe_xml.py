"""Parses XML files supplied by users: limited in size and depth, without entities, each element with its line number.

Built on the standard library's expat, configured to refuse what only attacks need. A package such as defusedxml would
add nothing but the refusal of entities, and has neither line numbers nor limits.
"""

import re
import stat
from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import NoReturn, Protocol
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.limits import MAX_MAP_BYTES, MAX_XML_DEPTH, MAX_XML_ELEMENTS
from simbev_ros.foundation.files.unpacking import read_unpacked


class LinedElement(Element):
    """An element with the 1-based number of the line in which it starts."""

    __slots__ = ("line",)
    line: int


class XmlTarget(Protocol):
    """Receives the elements of a file in their order."""

    def start(self, tag: str, attributes: dict[str, str], line: int) -> None:
        """Receive the start of an element, with the 1-based number of its line."""

    def end(self, tag: str, /) -> object:
        """Receive the end of an element."""

    def data(self, text: str, /) -> object:
        """Receive text between two tags."""


def parse(path: Path, root_tag: str, max_bytes: int = MAX_MAP_BYTES, max_elements: int = MAX_XML_ELEMENTS) -> Element:
    """Parse an XML file, plain or compressed, and return its root.

    Args:
        path: A regular file.
        root_tag: Required tag of the root element.
        max_bytes: Largest size of the file, unpacked.
        max_elements: Largest number of elements.

    Returns:
        The root; it and all its descendants are ``LinedElement``s, see ``place_of``.

    Raises:
        InputError: The file cannot be read, is too large, is not well-formed, has a document type declaration, is too
            deeply nested, or has another root.
    """
    tree = _Tree()
    read_elements(path, root_tag, tree, max_bytes, max_elements)
    return tree.builder.close()


def parse_text(text: str, root_tag: str, name: str, max_elements: int) -> Element:
    """Parse XML that is not in a file; ``name`` is what messages call it. See ``parse``."""
    tree = _Tree()
    reader = _Reader(Path(name), root_tag, tree, max_elements)
    _feed(reader, [text.encode()])
    return tree.builder.close()


def read_elements(path: Path, root_tag: str, target: XmlTarget, max_bytes: int, max_elements: int) -> None:
    """Parse an XML file, plain or compressed, without keeping it in memory; raises the errors of ``parse``.

    Args:
        path: A regular file.
        root_tag: Required tag of the root element.
        target: Receives the elements, the root included.
        max_bytes: Largest size of the file, unpacked.
        max_elements: Largest number of elements.
    """
    check_readable(path, max_bytes)
    _feed(_Reader(path, root_tag, target, max_elements), read_unpacked(path, max_bytes))


def _feed(reader: "_Reader", pieces: Iterable[bytes]) -> None:
    """Let a reader parse the pieces of a file, and close it."""
    try:
        for number, piece in enumerate(_with_plain_comments(pieces)):
            reader.parser.Parse(piece if number else _with_declaration_first(piece), False)
        reader.parser.Parse(b"", True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        hint = "; the file ends too early" if error.code in _TRUNCATED_CODES else ""
        reader.refuse(f"not valid XML: {reason}{hint}", error.lineno, error.offset + 1)
    except (LookupError, ValueError) as error:
        reader.refuse(f"its encoding is unknown: {error}", 1)
    finally:
        reader.close()


def _with_declaration_first(piece: bytes) -> bytes:
    """The beginning of a file with its XML declaration before any comment, where editors forget to put it.

    Other readers accept such files; the numbers of all later lines stay.
    """
    found = _COMMENT_BEFORE_DECLARATION.match(piece)
    return piece if found is None else found[2] + found[1] + piece[found.end() :]


_COMMENT_BEFORE_DECLARATION = re.compile(
    rb"((?:\s++|<!--(?:(?!-->).){0,4000}+-->){1,20}+)(<\?xml\s[^>\n]{0,200}\?>)", re.DOTALL
)


def _with_plain_comments(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """The pieces of a file without hyphens inside comments: two in a row are not XML, but other readers accept them.

    All positions stay.
    """
    opened, rest = b"", b""
    for piece in chain(pieces, [b""]):
        text, position, done = rest + piece, 0, list[bytes]()
        while True:
            found = (_CLOSINGS[opened] if opened else _OPENING).search(text, position)
            kept = max(position, len(text) - _LONGEST_MARK) if found is None else found.start()
            content = text[position:kept]
            done.append(content.replace(b"-", b" ") if opened == b"<!--" else content)
            if found is None:
                break
            done.append(found[0])
            opened, position = b"" if opened else found[0], found.end()
        rest = text[kept:]
        yield b"".join(done)
    yield rest


_OPENING = re.compile(rb"<!--|<!\[CDATA\[")
_CLOSINGS = {b"<!--": re.compile(rb"-->"), b"<![CDATA[": re.compile(rb"\]\]>")}
_LONGEST_MARK = len(b"<![CDATA[") - 1


def is_well_formed(content: bytes) -> bool:
    """Whether strict readers accept the content of a file that ``parse`` has read, with its declaration first."""
    try:
        expat.ParserCreate().Parse(_with_declaration_first(content), True)
    except expat.ExpatError:
        return False
    return True


def place_of(path: Path, element: Element) -> str:
    """``file:line`` of an element, for error messages."""
    return f"{path}:{element.line}" if isinstance(element, LinedElement) else str(path)


def line_of(element: Element | None) -> int:
    """1-based line of an element; 0 if it is None or was not read from a file."""
    return element.line if isinstance(element, LinedElement) else 0


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


class _Tree:
    """Fills an element tree."""

    def __init__(self) -> None:
        self.builder = TreeBuilder(element_factory=LinedElement)
        self.end, self.data = self.builder.end, self.builder.data

    def start(self, tag: str, attributes: dict[str, str], line: int) -> None:
        """Add an element that knows its line."""
        element: LinedElement = self.builder.start(tag, attributes)  # type: ignore[assignment]
        element.line = line


class _Reader:
    """An expat parser that refuses what is out of bounds and hands the rest to a target."""

    def __init__(self, path: Path, root_tag: str, target: XmlTarget, max_elements: int) -> None:
        self.parser = parser = expat.ParserCreate()
        self._path, self._root_tag, self._target, self._max_elements = path, root_tag, target, max_elements
        self._depth = self._elements = 0
        parser.buffer_text = True
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = target.data
        parser.StartDoctypeDeclHandler = self._doctype

    def refuse(self, problem: str, line: int, column: int | None = None) -> NoReturn:
        """Raise InputError with the problem and its position in the file."""
        location = f"{self._path}:{line}" if column is None else f"{self._path}:{line}:{column}"
        raise InputError(f"{location}: {problem}")

    def close(self) -> None:
        """Remove the handlers, which would keep the target alive through a reference cycle."""
        parser = self.parser
        parser.StartElementHandler = parser.EndElementHandler = parser.CharacterDataHandler = None
        parser.StartDoctypeDeclHandler = None

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self.parser.CurrentLineNumber
        if self._elements == 0 and tag != self._root_tag:
            self.refuse(f"the root element must be <{self._root_tag}>, not <{tag:.40}>", line)
        self._depth += 1
        self._elements += 1
        if self._depth > MAX_XML_DEPTH:
            self.refuse(f"elements are nested more than {MAX_XML_DEPTH} deep", line)
        if self._elements > self._max_elements:
            self.refuse(f"has more than {self._max_elements} elements", line)
        self._target.start(tag, attributes, line)

    def _end(self, tag: str) -> None:
        self._depth -= 1
        self._target.end(tag)

    def _doctype(self, *_: object) -> None:
        self.refuse("document type declarations (<!DOCTYPE>) are not accepted", self.parser.CurrentLineNumber)
