"""Repairs signal programs: every movement must get its turn, and no turn has green while its lane's light is red."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from xml.etree.ElementTree import Element, fromstring, tostring

from simbev_ros.maps.findings import Findings
from simbev_ros.maps.sumo.net import ControlledLink

_GREEN, _GOES, _HALTS = frozenset("Gg"), frozenset("GgyYu"), frozenset("ryYu")


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


def hold_turns_at_red(net: str, links: Iterable[ControlledLink], shown: Mapping[str, ControlledLink]) -> str:
    """The XML of a net in which no movement has green while the light of its lane does not.

    A movement that only had green while its light was red gives way when the light is green. Phases that end up
    without green are removed. ``shown`` has, by lane, the link whose state the light of the lane shows.
    """
    start, end, pairs = net.find("<tlLogic "), net.rfind("</tlLogic>") + len("</tlLogic>"), defaultdict(list)
    for link in links:
        if shown[link.lane].programme == link.programme and shown[link.lane].link != link.link:
            pairs[link.programme].append((link.link, shown[link.lane].link))
    root = fromstring(f"<net>{net[start:end]}</net>") if start >= 0 else Element("net")
    changes = [_hold_turns(logic, pairs[logic.get("id", "")]) for logic in root]
    text = "".join(tostring(logic, "unicode") for logic in root).rstrip()
    return net[:start] + text + net[end:] if any(changes) else net


def _hold_turns(logic: Element, pairs: Iterable[tuple[int, int]]) -> bool:
    """Hold turns in one program, given as pairs of a turn and the link that its light shows; whether any changes."""
    phases = logic.findall("phase")
    before = [phase.get("state", "") for phase in phases]
    states = [list(state) for state in before]
    for turn, light in pairs:
        own = [state[turn] for state in states]
        for state in states:
            if state[light] in _HALTS and state[turn] in _GOES:
                state[turn] = state[light]
        if not _GREEN.isdisjoint(own) and all(state[turn] not in _GREEN for state in states):
            for state in states:
                state[turn] = "g" if state[light] in _GREEN else state[light]
    is_plain = all("next" not in phase.attrib for phase in phases)  # otherwise phases are named by their numbers
    for phase, old, state in zip(phases, before, states, strict=True):
        phase.set("state", "".join(state))
        if is_plain and not _GOES.isdisjoint(old) and _GOES.isdisjoint(state):
            logic.remove(phase)
    return before != ["".join(state) for state in states]


def _served(phases: Iterable[Element]) -> set[int]:
    """The movements to which any of the phases shows green."""
    return {link for phase in phases for link, state in enumerate(phase.get("state", "")) if state in _GREEN}
