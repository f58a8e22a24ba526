"""Finds the elements of an OSM file by id, and their tags. Unlike in street maps, an id need not be a number."""

import re
from xml.etree.ElementTree import Element

from simbev_ros.maps.findings import Findings

_MAX_TAG_CHARS = 255
_ID = re.compile(r"[A-Za-z0-9.-]{1,40}")


def elements_by_id(root: Element, tag: str, notes: Findings) -> dict[str, Element]:
    """Elements that were not deleted, by id, in the order of the file; of several with one id the first one."""
    found: dict[str, Element] = {}
    for element in root.findall(tag):
        if element.get("visible") == "false" or element.get("action") == "delete":
            continue
        name = element.get("id", "")
        if name in found or not _ID.fullmatch(name):
            notes.left_out(f"a <{tag}> without an id of its own is left out", element, f"id={name[:40]!r}")
            continue
        found[name] = element
    return found


def tags_of(element: Element) -> dict[str, str]:
    """Tags of an element, cut off at a length that no meaningful key or value has."""
    return {tag.get("k", "")[:_MAX_TAG_CHARS]: tag.get("v", "")[:_MAX_TAG_CHARS] for tag in element.findall("tag")}
