"""Plays a recorded scene into a log: frame by frame, the most important first, within a limit of memory."""

import math
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from simbev_ros.dataset.frame import Frame
from simbev_ros.dataset.scene import Scene
from simbev_ros.foundation.errors import BagError
from simbev_ros.schema.trajectories import Tracks
from simbev_ros.show.rerun.drawings import layer_drawings, main_drawings
from simbev_ros.show.rerun.scene_log import SceneLog
from simbev_ros.show.rerun.subject import Detail, Drawing, Subject

_SENT_TOGETHER = 16
"""Ticks that are sent at once; the viewer takes few large packages faster than many small ones."""
_MAIN_SHARE = 0.5
"""Share of the memory for what is shown at first, if layers are drawn too."""
_LARGE = re.compile(r".*/(rgb|semantic|instance|depth|flow|points|semantic_points)|bev/.*|prediction/bev.*")
"""Keys of the samples that fill the memory; only these are thinned out."""


class ShownFrame:
    """A frame without those large samples that are left out, as only every Nth is shown.

    Samples of a sensor that is slower than the ticks are counted, so that none of them is left out if they are as far
    apart as the ticks that are shown.

    Args:
        frame: The frame.
        every: N, in ticks.
    """

    def __init__(self, frame: Frame, every: int) -> None:
        self._frame, self._every = frame, every
        self.tick, self.stamp_ns = frame.tick, frame.stamp_ns

    def __contains__(self, key: object) -> bool:
        return key in self._frame and self._is_shown(str(key))

    def __iter__(self) -> Iterator[str]:
        return (key for key in self._frame if self._is_shown(key))

    def __getitem__(self, key: str) -> Any:
        return self._frame[key]

    def messages(self, key: str) -> list[Any]:
        """The messages of a key."""
        return self._frame.messages(key)

    def _is_shown(self, key: str) -> bool:
        if self._every == 1 or not _LARGE.fullmatch(key):
            return True
        stamps_ns = self._frame.scene.sources[key].stamps_ns
        index = int(np.searchsorted(stamps_ns, self.stamp_ns, side="right")) - 1
        period_ns = (stamps_ns[-1] - stamps_ns[0]) / max(len(stamps_ns) - 1, 1)
        ticks = max(1, round(period_ns / self._frame.scene.tick_ns))
        return index % max(1, self._every // ticks) == 0


class ScenePlayer:
    """Draws all frames of a recorded scene.

    Args:
        scene: The scene; its bag may be cut off.
        log: Where to draw.
        detail: How much of it to draw.

    Attributes:
        every: Of the large samples, one in this many is shown; known once the first frame has been drawn.
        every_layer: The same of the layers.
        damage: Why the scene ends early, if it does.
    """

    def __init__(self, scene: Scene, log: SceneLog, detail: Detail) -> None:
        self._scene, self._log, self._detail = scene, log, detail
        self.subject = Subject(scene.view, _tracks_of(scene), detail)
        self.every, self.every_layer, self.damage = 1, 1, ""
        self._damaged_tick: int | None = None

    def play(self, advance: Callable[[], None]) -> None:
        """Draw all frames, then the layers of all frames.

        Args:
            advance: Called after each frame, twice if there are layers.
        """
        main = main_drawings(self._log, self.subject)
        layers = layer_drawings(self._log, self.subject) if self._detail.layers else []
        share = _MAIN_SHARE if layers else 1.0
        self.every = self._draw_all(main, share, advance)
        self.every_layer = self._draw_all(layers, 1.0 - share, advance)

    @property
    def steps(self) -> int:
        """Number of calls of ``advance`` for the whole scene."""
        return len(self._scene) * (1 + self._detail.layers)

    @property
    def has_predictions(self) -> bool:
        """Whether the bag holds bird's-eye views of a perception stack."""
        return any(key.startswith("prediction/bev") for key in self._scene.keys)

    @property
    def is_cut_off(self) -> bool:
        """Whether the bag was not closed by its writer."""
        return self._scene.is_cut_off

    def _draw_all(self, drawings: Sequence[Drawing], share: float, advance: Callable[[], None]) -> int:
        """Draw all frames up to a damaged one; return one in how many of the large samples fits."""
        before_bytes, every = self._log.size_bytes, 1
        for tick in range(len(self._scene)) if drawings else ():
            if tick == self._damaged_tick:
                break
            try:
                self._draw(tick, drawings, every)
            except BagError as error:
                self.damage, self._damaged_tick = str(error), tick
                break
            if tick == 0:
                size_bytes = (self._log.size_bytes - before_bytes) * len(self._scene)
                every = max(1, math.ceil(size_bytes / (share * self._detail.limit_bytes)))
            advance()
        return every

    def _draw(self, tick: int, drawings: Sequence[Drawing], every: int) -> None:
        frame = ShownFrame(self._scene[tick], every)
        self._log.begin(frame.tick, frame.stamp_ns)
        for drawing in drawings:
            drawing.draw(frame)
        if tick % _SENT_TOGETHER == 0:
            self._log.flush()


def _tracks_of(scene: Scene) -> Tracks | None:
    """The tracks, if the bag holds them; one that was cut off does not."""
    try:
        return scene.tracks
    except BagError:
        return None
