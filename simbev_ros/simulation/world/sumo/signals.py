"""Traffic lights: SUMO's signal programs with the scene's green times, and the state of every signal head at a tick.

The programs run by the clock alone, so the table of heads is computed from them without querying SUMO; those that a
command holds in a phase are set in SUMO at each change of phase.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.ragged import ragged_starts
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array, Int64Array, Table, UInt8Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.network import Signal
from simbev_ros.schema.scene.spec import ALL_RED_S, YELLOW_S, SceneSpec
from simbev_ros.schema.scene.state import SIGNAL_DTYPE, SignalState

_MIN_GREEN_S = 4.0
_FOREVER_TICKS = 10**7
_MAX_DELAY_TICKS = 1024
"""Ticks for which the phases of held programs are kept; the published state is a fraction of a second behind SUMO."""
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


class PhaseChange(NamedTuple):
    """A phase that a program, by its id, takes in SUMO for a number of ticks."""

    program: str
    phase: int
    ticks: int


@dataclass(frozen=True, slots=True)
class SignalProgram:
    """The cycle of one traffic-light program.

    Attributes:
        id: SUMO's traffic-light id.
        states: One string per phase; character k is the state of link k, in SUMO's letters.
        ticks: Length of each phase.
        offset_ticks: Tick since SUMO's start at which the first phase begins.
        green_s: Drawn green time.
    """

    id: str
    states: tuple[str, ...]
    ticks: tuple[int, ...]
    offset_ticks: int
    green_s: float


def signal_programs(spec: SceneSpec, net: str) -> tuple[SignalProgram, ...]:
    """All signal programs of a SUMO network (its XML), sorted by id, with the scene's green times and drawn offsets.

    On map files, the green time is that of the longest green phase of a program; shorter ones, as for left turns, are
    shorter in the same proportion.
    """
    tick_s = spec.tick_ns / NS_PER_S
    result = []
    logics = {logic.attrib["id"]: logic for logic in _logics(net)}
    for index, (_, logic) in enumerate(sorted(logics.items())):
        phases = [(float(phase.attrib["duration"]), phase.attrib["state"]) for phase in logic.findall("phase")]
        green_s = spec.green_time_s[index % len(spec.green_time_s)]
        states, ticks = zip(*_retime(phases, green_s, tick_s, keeps_shares=bool(spec.map.path)), strict=True)
        name = logic.attrib["id"]
        offset_ticks = int(stream(spec.seed, f"signals.{name}.offset").integers(sum(ticks)))
        result.append(SignalProgram(name, states, ticks, offset_ticks, green_s))
    return tuple(result)


def _logics(net: str) -> list[ElementTree.Element]:
    """The ``tlLogic`` elements of a SUMO network; parses only the text from the first to the last one."""
    start, end = net.find("<tlLogic "), net.rfind("</tlLogic>")
    return ElementTree.fromstring(f"<net>{net[start:end]}</tlLogic></net>").findall("tlLogic") if start >= 0 else []


def signal_programs_xml(programs: Sequence[SignalProgram], step_ns: int) -> str:
    """XML of a SUMO additional file that replaces the network's signal programs by these.

    One of SUMO's steps of ``step_ns`` is one tick.
    """
    root = ElementTree.Element("additional")
    for program in programs:
        offset = _seconds(program.offset_ticks, step_ns)
        attributes = {"id": program.id, "type": "static", "programID": "scene", "offset": offset}
        logic = ElementTree.SubElement(root, "tlLogic", attributes)
        for state, ticks in zip(program.states, program.ticks, strict=True):
            ElementTree.SubElement(logic, "phase", {"duration": _seconds(ticks, step_ns), "state": state})
    return ElementTree.tostring(root, encoding="unicode")


@dataclass(slots=True)
class _Held:
    """A program on its way to the phase in which it is held, or there: its phase, and its ticks in it.

    SUMO does not know of a new one yet.
    """

    target: int
    phase: int
    since: int
    is_new: bool = True


class SignalHeads:
    """The table of signal heads at any tick, computed for all programs at once.

    Commands hold programs in a phase; ``advance`` makes their changes, so it must be called for every tick then.
    """

    def __init__(self, signals: Sequence[Signal], programs: Sequence[SignalProgram], tick_ns: int) -> None:
        self._tick_s = tick_ns / NS_PER_S
        self._programs = tuple(programs)
        self._held: dict[int, _Held] = {}
        self._recent: dict[int, dict[int, _Held]] = {}
        self._table = _heads(signals, programs)
        self._offset = np.array([program.offset_ticks for program in programs], np.int64)
        self._length = np.array([sum(program.ticks) for program in programs], np.int64)
        max_phases = max((len(program.ticks) for program in programs), default=1)
        self._phase_ends = np.full((len(programs), max_phases), np.iinfo(np.int64).max)
        self._phase_starts = np.zeros((len(programs), max_phases), np.int64)
        self._state_at_phase = np.zeros((max_phases, len(signals)), np.uint8)
        self._held_ticks_at_phase = np.zeros((max_phases, len(signals)), np.int64)
        self._left_ticks_at_phase = np.zeros((max_phases, len(signals)))
        number = {program.id: index for index, program in enumerate(programs)}
        self._program_of_head = np.array([number[signal.programme] for signal in signals], np.int64)
        for index, program in enumerate(programs):
            phases = len(program.ticks)
            self._phase_ends[index, :phases] = np.cumsum(program.ticks)
            self._phase_starts[index, 1:phases] = self._phase_ends[index, : phases - 1]
            rows = np.flatnonzero(self._program_of_head == index)
            links = [signals[row].link for row in rows.tolist()]
            shown = np.array([[_STATE_OF[state[link]] for link in links] for state in program.states], np.uint8)
            self._state_at_phase[:phases, rows] = shown
            self._held_ticks_at_phase[:phases, rows] = _held_ticks(shown, np.array(program.ticks))
            self._left_ticks_at_phase[:phases, rows] = _left_ticks(shown, np.array(program.ticks))

    def hold(self, head: int, state: SignalState, tick: int) -> None:
        """Let a head's program go on to its next phase in which the head has a state, and stay there.

        On the way, green phases end at once; yellow and all-red ones keep their duration.

        Args:
            head: Id of the head.
            state: Red or green.
            tick: The tick since SUMO's start at which the program leaves its cycle.

        Raises:
            InputError: There is no such head, or it never has the state.
        """
        if not 1 <= head <= len(self._table):
            raise InputError(f"id: is {head}; allowed: 1 to {len(self._table)}, the ids on /world/signals")
        index = int(self._program_of_head[head - 1])
        program = self._programs[index]
        (now,), (since,) = self._phases(tick, np.array([index]))
        held = self._held.get(index) or _Held(int(now), int(now), int(since))
        order = [(held.phase + step) % len(program.ticks) for step in range(len(program.ticks))]
        shown = [phase for phase in order if self._state_at_phase[phase, head - 1] == state]
        if not shown:
            raise InputError(f"state: signal {head} is never {state.name.lower()}")
        green = [phase for phase in shown if _kind(program.states[phase]) == "green"]
        self._held[index] = replace(held, target=(green or shown)[0])

    def release(self, head: int, tick: int) -> list[PhaseChange]:
        """Let a head's program, or with 0 all programs, go on in their cycles from where they are; see ``advance``.

        Raises:
            InputError: There is no such head.
        """
        if not 0 <= head <= len(self._table):
            raise InputError(f"id: is {head}; allowed: 0 for all, and the ids on /world/signals to {len(self._table)}")
        changes = []
        for index in [*self._held] if head == 0 else [int(self._program_of_head[head - 1])]:
            if (held := self._held.pop(index, None)) is not None:
                program = self._programs[index]
                since = min(held.since, program.ticks[held.phase] - 1)
                self._offset[index] = tick - self._phase_starts[index, held.phase] - since
                changes.append(PhaseChange(program.id, held.phase, program.ticks[held.phase] - since))
        return changes

    def advance(self, tick: int) -> list[PhaseChange]:
        """Move held programs on to a tick since SUMO's start; return the phases that SUMO has to take.

        It must be called before SUMO simulates what follows this tick.
        """
        changes = []
        for index, held in self._held.items():
            program, before = self._programs[index], held.phase
            held.since += not held.is_new
            is_green = _kind(program.states[held.phase]) == "green"
            is_over = is_green or held.since >= program.ticks[held.phase]
            if held.phase != held.target and is_over and not held.is_new:
                following = (held.phase + 1) % len(program.ticks)
                is_clear = not is_green and _kind(program.states[following]) == "green"
                held.phase, held.since = held.target if is_clear else following, 0
            if held.is_new or held.phase != before:
                changes.append(PhaseChange(program.id, held.phase, _FOREVER_TICKS))
            held.is_new = False
        if self._held:
            self._recent[tick] = {index: replace(held) for index, held in self._held.items()}
            self._recent.pop(tick - _MAX_DELAY_TICKS, None)
        return changes

    def _phases(self, tick: int, programs: Int64Array) -> tuple[Int64Array, Int64Array]:
        """(P,) phase of some programs in their cycles at a tick, and (P,) ticks since its start."""
        in_cycle = (tick - self._offset[programs]) % self._length[programs]
        phase = np.sum(self._phase_ends[programs] <= in_cycle[:, None], axis=1)
        return phase, in_cycle - self._phase_starts[programs, phase]

    def table_at(self, tick: int) -> Table:
        """(S,) ``SIGNAL_DTYPE`` at a tick since SUMO's start; negative ticks lie before it."""
        phase, since = self._phases(tick, np.arange(len(self._offset)))
        held = self._recent.get(tick, {})
        for index, program in held.items():
            phase[index], since[index] = program.phase, program.since
        heads = np.arange(len(self._table))
        table = self._table.copy()
        table["state"] = self._state_at_phase[phase[self._program_of_head], heads]
        table["time_in_state"] = (
            self._held_ticks_at_phase[phase[self._program_of_head], heads] + since[self._program_of_head]
        ) * self._tick_s
        table["time_remaining"] = (
            self._left_ticks_at_phase[phase[self._program_of_head], heads] - since[self._program_of_head]
        ) * self._tick_s
        still = [index for index, program in held.items() if program.phase == program.target]
        table["time_remaining"][np.isin(self._program_of_head, still)] = np.inf
        return table


def _retime(
    phases: Sequence[tuple[float, str]], green_s: float, tick_s: float, keeps_shares: bool = False
) -> list[tuple[str, int]]:
    """States and ticks of the phases with the given green, yellow and all-red times.

    Consecutive green phases (SUMO ends the pedestrians' green earlier) share the green time in their old proportion.
    With ``keeps_shares``, the longest such group has the green time, and others their old share of it. After each
    yellow phase, the yellow links are red for the all-red time.
    """
    longest_s = max((sum(duration for duration, _ in group) for group in _green_groups(phases)), default=0.0)
    yellow, all_red = round(YELLOW_S / tick_s), round(ALL_RED_S / tick_s)
    result: list[tuple[str, int]] = []
    for kind, group in groupby(phases, key=lambda phase: _kind(phase[1])):
        members = list(group)
        if kind == "green":
            ends = np.cumsum([duration for duration, _ in members])
            own_s = max(green_s * ends[-1] / longest_s, min(_MIN_GREEN_S, green_s)) if keeps_shares else green_s
            ticks = np.diff(np.round(ends / ends[-1] * own_s / tick_s), prepend=0.0)
            result += [(state, max(int(n), 1)) for (_, state), n in zip(members, ticks, strict=True)]
        elif kind == "yellow":
            for _, state in members:
                result += [(state, yellow), (state.replace("y", "r").replace("Y", "r"), all_red)]
        elif not result or _kind(result[-1][0]) == "green":
            result += [(state, all_red) for _, state in members]
    return result


def _green_groups(phases: Sequence[tuple[float, str]]) -> list[list[tuple[float, str]]]:
    """The groups of consecutive green phases."""
    groups = groupby(phases, key=lambda phase: _kind(phase[1]))
    return [list(group) for kind, group in groups if kind == "green"]


def _kind(state: str) -> str:
    """Whether a phase is yellow, green or, if neither, red."""
    lower = state.lower()
    return "yellow" if "y" in lower else "green" if "g" in lower else "red"


def _held_ticks(shown: UInt8Array, ticks: Int64Array) -> Int64Array:
    """(P, S) ticks for which each head has shown its state at the start of each phase.

    A head that never changes has shown it for one cycle.
    """
    twice = np.concatenate([shown, shown])
    start = ragged_starts(np.tile(ticks, 2))
    changed = np.vstack([np.ones((1, shown.shape[1]), bool), twice[1:] != twice[:-1]])
    since = np.maximum.accumulate(np.where(changed, start[:, None], 0))
    return (start[:, None] - since)[len(ticks) :]


def _left_ticks(shown: UInt8Array, ticks: Int64Array) -> Float64Array:
    """(P, S) ticks from the start of each phase until each head changes; infinite if it never does."""
    twice = np.concatenate([shown, shown])
    end = np.cumsum(np.tile(ticks, 2))
    changes = np.vstack([twice[1:] != twice[:-1], np.zeros((1, shown.shape[1]), bool)])
    until: Float64Array = np.minimum.accumulate(np.where(changes, end[:, None], np.inf)[::-1])[::-1]
    return (until - (end - np.tile(ticks, 2))[:, None])[: len(ticks)]


def _heads(signals: Sequence[Signal], programs: Sequence[SignalProgram]) -> Table:
    """Signal-head table with the constant columns filled in."""
    green_s = {program.id: program.green_s for program in programs}
    table = np.zeros(len(signals), SIGNAL_DTYPE)
    if signals:
        positions_m: Float64Array = np.stack([signal.position_m for signal in signals])
        table["x"], table["y"], table["z"] = positions_m.T
    table["yaw"] = [signal.yaw_rad for signal in signals]
    table["green_time"] = [green_s[signal.programme] for signal in signals]
    table["id"] = np.arange(1, len(signals) + 1)
    return table


def _seconds(ticks: int, step_ns: int) -> str:
    return f"{ticks * step_ns / NS_PER_S:.3f}"
