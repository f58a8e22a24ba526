"""Traffic lights: SUMO's programmes with the scene's green times, and what every signal head shows at a tick.

The programmes run by the clock alone, so the table of heads is computed from them and needs no query of SUMO.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from xml.etree import ElementTree

import numpy as np

from simbev_ros.maps.network import Signal
from simbev_ros.random import stream
from simbev_ros.scene.spec import NS_PER_S, SceneSpec
from simbev_ros.scene.state import SIGNAL_DTYPE, SignalState
from simbev_ros.types import Float64Array, Int64Array, Table, UInt8Array

YELLOW_S = 3.0
ALL_RED_S = 2.0
_STATE_OF = {
    "G": SignalState.GREEN,
    "g": SignalState.GREEN,
    "y": SignalState.YELLOW,
    "Y": SignalState.YELLOW,
    "r": SignalState.RED,
    "s": SignalState.RED,
    "u": SignalState.RED_YELLOW,
    "o": SignalState.OFF,
    "O": SignalState.OFF,
}


@dataclass(frozen=True, slots=True)
class Programme:
    """The cycle of one traffic-light programme.

    Attributes:
        id: SUMO's traffic-light id.
        states: One string for each phase; character k is what link k sees, in SUMO's letters.
        ticks: Length of each phase.
        offset_ticks: The tick since SUMO's start at which the first phase begins.
        green_s: Green time as drawn.
    """

    id: str
    states: tuple[str, ...]
    ticks: tuple[int, ...]
    offset_ticks: int
    green_s: float


def programmes(spec: SceneSpec, net: str) -> tuple[Programme, ...]:
    """All programmes of a SUMO net (its XML), by id, with the scene's green times and a drawn offset."""
    tick_s = spec.tick_ns / NS_PER_S
    result = []
    logics = {logic.attrib["id"]: logic for logic in _logics(net)}
    for index, (_, logic) in enumerate(sorted(logics.items())):
        phases = [(float(phase.attrib["duration"]), phase.attrib["state"]) for phase in logic.findall("phase")]
        green_s = spec.green_time_s[index % len(spec.green_time_s)]
        states, ticks = zip(*_retimed(phases, green_s, tick_s), strict=True)
        name = logic.attrib["id"]
        offset_ticks = int(stream(spec.seed, f"signals.{name}.offset").integers(sum(ticks)))
        result.append(Programme(name, states, ticks, offset_ticks, green_s))
    return tuple(result)


def _logics(net: str) -> list[ElementTree.Element]:
    """The elements ``tlLogic`` of a SUMO net: only the part from the first to the last one is parsed."""
    start, end = net.find("<tlLogic "), net.rfind("</tlLogic>")
    return ElementTree.fromstring(f"<net>{net[start:end]}</tlLogic></net>").findall("tlLogic") if start >= 0 else []


def programmes_xml(cycles: Sequence[Programme], tick_ns: int) -> str:
    """An additional file of SUMO's that puts these programmes in place of the net's."""
    root = ElementTree.Element("additional")
    for cycle in cycles:
        offset = _seconds(cycle.offset_ticks, tick_ns)
        attributes = {"id": cycle.id, "type": "static", "programID": "scene", "offset": offset}
        logic = ElementTree.SubElement(root, "tlLogic", attributes)
        for state, ticks in zip(cycle.states, cycle.ticks, strict=True):
            ElementTree.SubElement(logic, "phase", {"duration": _seconds(ticks, tick_ns), "state": state})
    return ElementTree.tostring(root, encoding="unicode")


class SignalHeads:
    """The table of signal heads over time, computed for all programmes at once."""

    def __init__(self, signals: Sequence[Signal], cycles: Sequence[Programme], tick_ns: int) -> None:
        self._tick_s = tick_ns / NS_PER_S
        self._table = _heads(signals, cycles)
        self._offset = np.array([cycle.offset_ticks for cycle in cycles], np.int64)
        self._length = np.array([sum(cycle.ticks) for cycle in cycles], np.int64)
        most = max((len(cycle.ticks) for cycle in cycles), default=1)
        self._ends = np.full((len(cycles), most), np.iinfo(np.int64).max)
        self._begins = np.zeros((len(cycles), most), np.int64)
        self._shown = np.zeros((most, len(signals)), np.uint8)
        self._held = np.zeros((most, len(signals)), np.int64)
        self._left = np.zeros((most, len(signals)))
        number = {cycle.id: index for index, cycle in enumerate(cycles)}
        self._cycle = np.array([number[signal.programme] for signal in signals], np.int64)
        for index, cycle in enumerate(cycles):
            phases = len(cycle.ticks)
            self._ends[index, :phases] = np.cumsum(cycle.ticks)
            self._begins[index, 1:phases] = self._ends[index, : phases - 1]
            rows = np.flatnonzero(self._cycle == index)
            links = [signals[row].link for row in rows.tolist()]
            shown = np.array([[_STATE_OF[state[link]] for link in links] for state in cycle.states], np.uint8)
            self._shown[:phases, rows] = shown
            self._held[:phases, rows] = _held_ticks(shown, np.array(cycle.ticks))
            self._left[:phases, rows] = _left_ticks(shown, np.array(cycle.ticks))

    def at(self, tick: int) -> Table:
        """(S,) ``SIGNAL_DTYPE`` at a tick since SUMO's start (negative: before it)."""
        in_cycle = (tick - self._offset) % self._length
        phase = np.sum(self._ends <= in_cycle[:, None], axis=1)
        since = in_cycle - self._begins[np.arange(len(phase)), phase]
        heads = np.arange(len(self._table))
        table = self._table.copy()
        table["state"] = self._shown[phase[self._cycle], heads]
        table["time_in_state"] = (self._held[phase[self._cycle], heads] + since[self._cycle]) * self._tick_s
        table["time_remaining"] = (self._left[phase[self._cycle], heads] - since[self._cycle]) * self._tick_s
        return table


def _retimed(phases: Sequence[tuple[float, str]], green_s: float, tick_s: float) -> list[tuple[str, int]]:
    """States and ticks of the phases with given green, yellow and all-red times.

    Neighbouring green phases (SUMO ends a pedestrians' green earlier) share the green time in their old proportion.
    Behind each yellow phase, what was yellow is red for the all-red time.
    """
    yellow, all_red = round(YELLOW_S / tick_s), round(ALL_RED_S / tick_s)
    result: list[tuple[str, int]] = []
    for kind, group in groupby(phases, key=lambda phase: _kind(phase[1])):
        members = list(group)
        if kind == "green":
            ends = np.cumsum([duration for duration, _ in members])
            ticks = np.diff(np.round(ends / ends[-1] * green_s / tick_s), prepend=0.0)
            result += [(state, max(int(n), 1)) for (_, state), n in zip(members, ticks, strict=True)]
        elif kind == "yellow":
            for _, state in members:
                result += [(state, yellow), (state.replace("y", "r").replace("Y", "r"), all_red)]
        elif not result or _kind(result[-1][0]) == "green":
            result += [(state, all_red) for _, state in members]
    return result


def _kind(state: str) -> str:
    """Whether a phase is yellow, green or (neither) red."""
    lower = state.lower()
    return "yellow" if "y" in lower else "green" if "g" in lower else "red"


def _held_ticks(shown: UInt8Array, ticks: Int64Array) -> Int64Array:
    """(P, S) ticks for which each head has shown its state when phase p begins.

    A head that never changes has shown it for one cycle.
    """
    twice = np.concatenate([shown, shown])
    begin = np.cumsum(np.tile(ticks, 2)) - np.tile(ticks, 2)
    changed = np.vstack([np.ones((1, shown.shape[1]), bool), twice[1:] != twice[:-1]])
    since = np.maximum.accumulate(np.where(changed, begin[:, None], 0))
    held: Int64Array = (begin[:, None] - since)[len(ticks) :]
    return held


def _left_ticks(shown: UInt8Array, ticks: Int64Array) -> Float64Array:
    """(P, S) ticks until each head changes, from the beginning of phase p on; infinite where it never does."""
    twice = np.concatenate([shown, shown])
    end = np.cumsum(np.tile(ticks, 2))
    changes = np.vstack([twice[1:] != twice[:-1], np.zeros((1, shown.shape[1]), bool)])
    until: Float64Array = np.minimum.accumulate(np.where(changes, end[:, None], np.inf)[::-1])[::-1]
    left: Float64Array = (until - (end - np.tile(ticks, 2))[:, None])[: len(ticks)]
    return left


def _heads(signals: Sequence[Signal], cycles: Sequence[Programme]) -> Table:
    """The columns that stay the same."""
    green_s = {cycle.id: cycle.green_s for cycle in cycles}
    table = np.zeros(len(signals), SIGNAL_DTYPE)
    if signals:
        positions_m: Float64Array = np.stack([signal.position_m for signal in signals])
        table["x"], table["y"], table["z"] = positions_m.T
    table["yaw"] = [signal.yaw_rad for signal in signals]
    table["green_time"] = [green_s[signal.programme] for signal in signals]
    table["id"] = np.arange(1, len(signals) + 1)
    return table


def _seconds(ticks: int, tick_ns: int) -> str:
    return f"{ticks * tick_ns / NS_PER_S:.3f}"
