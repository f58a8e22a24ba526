"""Collects what a reader finds in a map's file: what it leaves out, repairs, or has to assume."""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from simbev_ros.foundation.files.limits import MAX_FINDINGS
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.safe_xml import line_of

WALKED_VERGES = "where roads of up to 60 km/h have no sidewalks, people walk on their verges"
"""Rule of the finding that a map has footways on unpaved verges."""


class Outcome(StrEnum):
    """Consequence of a finding for the map."""

    LEFT_OUT = "left out"
    REPAIRED = "repaired"
    ASSUMED = "assumed"


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """One place in a map's file, or several of a kind that are counted together.

    Attributes:
        rule: What was found, in the same words at all places of a kind.
        outcome: What it means for the map.
        count: Number of places.
        line: Line of the file, 0 if there is none.
        detail: What is special about the place, or "".
        position_m: (2,) position of the place, map frame; None if it has none.
        lost_m: Length of the driving lanes that are lost.
    """

    rule: str
    outcome: Outcome = Outcome.LEFT_OUT
    count: int = 1
    line: int = 0
    detail: str = ""
    position_m: Float64Array | None = None
    lost_m: float = 0.0


@dataclass(eq=False)
class Findings:
    """The findings in one file, in order. Of each rule ``MAX_FINDINGS`` places are kept; further ones are counted.

    Attributes:
        path: The file.
    """

    path: Path
    _found: list[Finding] = field(default_factory=list)
    _last_row: dict[str, int] = field(default_factory=dict)
    _places: Counter[str] = field(default_factory=Counter)

    def left_out(
        self,
        rule: str,
        element: Element | None = None,
        detail: str = "",
        position_m: Float64Array | None = None,
        lost_m: float = 0.0,
    ) -> None:
        """Record something of the file that the map lacks; arguments as for ``Finding``."""
        self.add(Finding(rule, Outcome.LEFT_OUT, 1, line_of(element), detail, position_m, lost_m))

    def repaired(
        self, rule: str, element: Element | None = None, detail: str = "", position_m: Float64Array | None = None
    ) -> None:
        """Record something that the map has in another form than the file; arguments as for ``Finding``."""
        self.add(Finding(rule, Outcome.REPAIRED, 1, line_of(element), detail, position_m))

    def assumed(self, rule: str, element: Element | None = None, detail: str = "") -> None:
        """Record something that the file does not say; arguments as for ``Finding``."""
        self.add(Finding(rule, Outcome.ASSUMED, 1, line_of(element), detail))

    def add(self, *found: Finding) -> None:
        """Record findings."""
        for finding in found:
            row = self._last_row.get(finding.rule, -1)
            if row >= 0 and self._places[finding.rule] >= MAX_FINDINGS:
                last = self._found[row]
                self._found[row] = replace(last, count=last.count + finding.count, lost_m=last.lost_m + finding.lost_m)
                continue
            self._last_row[finding.rule] = len(self._found)
            self._places[finding.rule] += 1
            self._found.append(finding)

    def transform(self, map_from_file: Callable[[Float64Array], Float64Array]) -> None:
        """Transform the positions of all findings by a function of (N, 3) points."""
        for row, finding in enumerate(self._found):
            if finding.position_m is not None:
                moved_m = map_from_file(np.append(finding.position_m, 0.0)[None])[0, :2]
                self._found[row] = replace(finding, position_m=moved_m)

    def all(self) -> tuple[Finding, ...]:
        """All findings in their order."""
        return tuple(self._found)

    def sentences(self) -> tuple[str, ...]:
        """One sentence for each rule, see ``sentences_of``."""
        return sentences_of(self.path.name, self._found)


def sentences_of(name: str, findings: Iterable[Finding]) -> tuple[str, ...]:
    """One sentence for each rule: where it was found first, and how often; ``name`` is that of the file."""
    by_rule: dict[str, list[Finding]] = {}
    for finding in findings:
        by_rule.setdefault(finding.rule, []).append(finding)
    return tuple(_sentence(name, group) for group in by_rule.values())


def _sentence(name: str, group: list[Finding]) -> str:
    first, count = group[0], sum(finding.count for finding in group)
    place = f"{name}:{first.line}: " if first.line else ""
    lost_km = sum(finding.lost_m for finding in group) / 1e3
    details = [first.detail] if first.detail else []
    details += [f"{count} times"] if count > 1 else []
    details += [f"{lost_km:.2f} km of lanes"] if lost_km >= 0.005 else []
    return f"{place}{first.rule}" + (f" ({'; '.join(details)})" if details else "")
