from pathlib import Path

import pytest

from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.safe_xml import line_of, parse, place_of

LAUGHS = """<?xml version="1.0"?>
<!DOCTYPE net [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>
<net>&b;</net>"""
OUTSIDE = """<!DOCTYPE net [<!ENTITY a SYSTEM "file:///etc/passwd">]><net>&a;</net>"""


def test_every_element_knows_its_line(tmp_path: Path) -> None:
    path = tmp_path / "a.net.xml"
    path.write_text('<net>\n <edge id="1">\n  <lane/>\n </edge>\n <edge id="2">text</edge>\n</net>\n')
    root = parse(path, "net")
    places = [place_of(path, element) for element in (root, *root.iter("edge"), *root.iter("lane"))]
    assert places == [f"{path}:{line}" for line in (1, 2, 5, 3)]
    assert (root[1].attrib, root[1].text) == ({"id": "2"}, "text")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"<net>\n  <edge>\n", "3:1: not valid XML: no element found; the file ends too early"),
        (b"<net>\n  <edge></lane>", "2:11: not valid XML: mismatched tag"),
        (b'<net>\n<edge id="1', "2:1: not valid XML: unclosed token; the file ends too early"),
        (b"<net>\n\0</net>", "2:1: not valid XML"),
        (b"\0" * 100, "1:1: not valid XML"),
        (b"\x89PNG\r\n\x1a\n", "1:1: not valid XML"),
        (b'<net name="\xff"/>', "1:12: not valid XML"),
        (b'<?xml version="1.0" encoding="shift-jis"?><net/>', "its encoding is unknown"),
        (b"<osm/>", "1: the root element must be <net>, not <osm>"),
        (b"<net>" + b"<edge>" * 100_000, "1: elements are nested more than 64 deep"),
        (LAUGHS.encode(), "2: document type declarations (<!DOCTYPE>) are not accepted"),
        (LAUGHS.encode("utf-16"), "2: document type declarations (<!DOCTYPE>) are not accepted"),
        (OUTSIDE.encode(), "1: document type declarations (<!DOCTYPE>) are not accepted"),
    ],
)
def test_invalid_xml_is_refused_with_its_location(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "bad.xml"
    path.write_bytes(content)
    with pytest.raises(InputError) as raised:
        parse(path, "net")
    assert str(raised.value).startswith(f"{path}:")
    assert message in str(raised.value)


def test_a_huge_file_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "huge.xml"
    with path.open("wb") as stream:
        stream.truncate(200 << 20)
    with pytest.raises(InputError, match="has 200 MiB; at most 128 MiB are read"):
        parse(path, "net")


@pytest.mark.parametrize(
    ("path", "message"),
    [("/dev/zero", "is not a file"), ("/", "is not a file"), ("/nowhere", "cannot be read: No such file")],
)
def test_paths_that_are_not_files_are_refused(path: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse(Path(path), "net")


@pytest.mark.parametrize("start", ["<!-- made by hand -->\n", "\n\n  ", "<!-- one -->\n<!-- two\n lines -->\n"])
def test_a_comment_before_the_declaration_is_accepted(tmp_path: Path, start: str) -> None:
    path = tmp_path / "a.xodr"
    path.write_text(
        f'{start}<?xml version="1.0" encoding="latin-1"?>\n<OpenDRIVE>\n<road name="é"/></OpenDRIVE>', "latin-1"
    )
    (road,) = parse(path, "OpenDRIVE")
    assert road.get("name") == "é"
    assert line_of(road) == start.count("\n") + 3


@pytest.mark.parametrize("pad", range(12))
def test_hyphens_in_comments_are_read_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pad: int) -> None:
    text = " " * pad + "<net><!-- a -- b --><!-- c ---><!----><edge id='x--y'><![CDATA[<!-- - -->]]></edge>\n<a/></net>"
    pieces = [text.encode()[start : start + 10] for start in range(0, len(text), 10)]
    monkeypatch.setattr("simbev_ros.maps.safe_xml.read_unpacked", lambda *_: pieces)
    path = tmp_path / "a.xml"
    path.write_text(text)
    root = parse(path, "net")
    assert (root[0].attrib, root[0].text, line_of(root[1])) == ({"id": "x--y"}, "<!-- - -->", 2)
