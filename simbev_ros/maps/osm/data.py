"""The content of an OpenStreetMap file: nodes, ways and multipolygons with their tags, in geographic coordinates."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Finding

Tags = Mapping[str, str]


class Way(NamedTuple):
    """A way: node indices, at least two; an outline if it ends at its first node."""

    id: str
    nodes: tuple[int, ...]
    tags: Tags

    @property
    def closed(self) -> bool:
        """Whether it is an outline."""
        return len(self.nodes) > 3 and self.nodes[0] == self.nodes[-1]


class Multipolygon(NamedTuple):
    """An area made of several ways: parts of its outer and inner outlines in any order."""

    outer: tuple[Way, ...]
    inner: tuple[Way, ...]
    tags: Tags


@dataclass(frozen=True, slots=True)
class OsmData:
    """The content of an OpenStreetMap file.

    Attributes:
        longitude_latitude_deg: (N, 2) coordinates of the nodes.
        node_tags: Tags by node index, for nodes that have any.
        ways: In the order of the file.
        multipolygons: In the order of the file, without incomplete ones.
        findings: Repairs and omissions.
        driving_side: ``left`` or ``right``, as tagged at the boundaries in the file, or at most of its roads; empty if
            no tag says it.
        left_hand: Traffic keeps to the left, by ``driving_side`` or by the country.
        is_part: It is not the whole file, but a part cut out of it.
    """

    longitude_latitude_deg: Float64Array
    node_tags: Mapping[int, Tags]
    ways: tuple[Way, ...]
    multipolygons: tuple[Multipolygon, ...]
    findings: tuple[Finding, ...]
    driving_side: str = ""
    left_hand: bool = False
    is_part: bool = False


def add_tags(element: Element, tags: Tags) -> None:
    """Add tags to an element of an OpenStreetMap file that is written."""
    for key, value in tags.items():
        SubElement(element, "tag", k=key, v=value)
