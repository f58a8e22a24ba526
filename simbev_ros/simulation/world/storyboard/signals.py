"""Traffic signals of a storyboard: what actions and the cycles of its controllers make the heads show."""

import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from simbev_ros.foundation.types import Table
from simbev_ros.maps.network import Signal
from simbev_ros.scene.storyboard.model import Element
from simbev_ros.schema.scene.state import SignalState

_BULBS = (SignalState.RED, SignalState.YELLOW, SignalState.GREEN)
_WORDS = {"red": SignalState.RED, "yellow": SignalState.YELLOW, "amber": SignalState.YELLOW, "green": SignalState.GREEN}
_ON = ("on", "true", "1", "flashing")


class StoryboardSignals:
    """States of the signals that a storyboard has set, as texts of the file.

    Attributes:
        states: States of signals by id.
        phases: Current phases of controllers by name.
    """

    def __init__(self, controllers: Iterable[Element], heads: Sequence[Signal] = ()) -> None:
        """For ``TrafficSignalController`` elements, and the heads of a map in the rows of its table."""
        self._controllers = {each.name: each for each in controllers}
        self._starts_s = {name: -_delay_s(name, self._controllers) for name in self._controllers}
        self._heads: dict[str, list[int]] = {}
        for row, head in enumerate(heads):
            self._heads.setdefault(head.opendrive_id, []).append(row)
        self.states: dict[str, str] = {}
        self.phases: dict[str, str] = {}

    def start_phase(self, controller: str, phase: str, time_s: float) -> None:
        """Let the cycle of a controller go on from the start of a phase."""
        before_s = 0.0
        for each in self._controllers[controller].phases:
            if each.name == phase:
                self._starts_s[controller] = before_s - time_s
                self.advance(time_s)
                return
            before_s += each.duration_s

    def advance(self, time_s: float) -> None:
        """Let the controllers change phases up to a time."""
        for name, controller in self._controllers.items():
            cycle_s = sum(phase.duration_s for phase in controller.phases)
            at_s = time_s + self._starts_s[name]
            if cycle_s <= 0.0 or at_s < 0.0:
                continue
            ends_s = np.cumsum([phase.duration_s for phase in controller.phases])
            phase = controller.phases[int(np.searchsorted(ends_s, at_s % cycle_s + 1e-9, side="right")) % len(ends_s)]
            if self.phases.get(name) != phase.name:
                self.phases[name] = phase.name
                self.states |= {each.traffic_signal_id: each.state for each in phase.states}

    def shown(self, table: Table) -> Table:
        """(S,) ``SIGNAL_DTYPE`` with the states that have been set; the times of these heads are 0 and infinite."""
        rows = {row: state_of(text) for name, text in self.states.items() for row in self._heads.get(name, ())}
        if rows:
            table = table.copy()
            at = list(rows)
            changed = table["state"][at] != list(rows.values())
            table["state"][at] = list(rows.values())
            table["time_in_state"][at] = np.where(changed, 0.0, table["time_in_state"][at])
            table["time_remaining"][at] = np.inf
        return table


def state_of(text: str) -> SignalState:
    """The state that a text of a file means: names of colors, or ``on`` and ``off`` of three bulbs from the top."""
    bulbs = [part.strip().lower() for part in re.split("[;,]", text)]
    lit = {state for state, bulb in zip(_BULBS, bulbs, strict=False) if bulb in _ON}
    lit |= {state for word, state in _WORDS.items() if word in text.lower()}
    if lit == {SignalState.RED, SignalState.YELLOW}:
        return SignalState.RED_YELLOW
    return next(iter(lit), SignalState.OFF)


def _delay_s(name: str, controllers: Mapping[str, Element]) -> float:
    """Delay of a controller, after the one that it refers to."""
    delay_s, seen = 0.0, set[str]()
    while name in controllers and name not in seen:
        seen.add(name)
        delay_s, name = delay_s + controllers[name].delay_s, controllers[name].reference or ""
    return delay_s
