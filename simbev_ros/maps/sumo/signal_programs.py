"""Repairs the traffic lights of a user's SUMO net: every movement must get its turn."""

from collections import defaultdict
from collections.abc import Iterable
from xml.etree.ElementTree import Element

from simbev_ros.maps.findings import Findings

_GREEN = frozenset("Gg")


def join_partial_programs(root: Element, findings: Findings) -> None:
    """Join the programs of a traffic light that are switched by hand, as in SUMO's games.

    Of several programs, the last one would run. If it never shows green to movements that others serve, they run one
    after the other, in the order of the file.
    """
    programs: dict[str, list[Element]] = defaultdict(list)
    for logic in root.findall("tlLogic"):
        programs[logic.get("id", "")].append(logic)
    for name, (first, *others) in programs.items():
        phases = [phase for logic in (first, *others) for phase in logic.iter("phase")]
        if others and _served(others[-1].iter("phase")) != _served(phases):
            for other in others:
                first.extend(other.findall("phase"))
                root.remove(other)
            findings.repaired("programs of a traffic light that leave out movements run one after another", first, name)


def _served(phases: Iterable[Element]) -> set[int]:
    """The movements to which any of the phases shows green."""
    return {link for phase in phases for link, state in enumerate(phase.get("state", "")) if state in _GREEN}
