"""Entities of a scene on their way to Rerun: into a file, or to the server that browsers connect to.

All coordinates below ``WORLD`` are those of the map frame, below ``EGO`` those of the ego, and so on.
"""

from pathlib import Path
from typing import Any, Self

import rerun as rr

from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.agents import AgentView

APPLICATION = "simbev_ros"
TIME, TICK = "time", "tick"
"""Time lines: simulated time since the start of the scene, and number of the tick."""
WORLD, EGO = "world", "world/ego"


_BATCH_BYTES, _BATCH_S = 32 << 20, 2.0


def _batches() -> rr.ChunkBatcherConfig:
    """Rows of an entity that are sent together; each package costs the viewer time and memory."""
    config = rr.ChunkBatcherConfig()
    config.flush_num_bytes, config.flush_tick = _BATCH_BYTES, _BATCH_S
    return config


class SceneLog:
    """A Rerun recording of one scene as one agent sees it.

    Args:
        view: The scene as the agent sees it.
        run: Text that distinguishes several runs of the same scene.

    Attributes:
        size_bytes: Size of everything that was logged with a time.
    """

    def __init__(self, view: AgentView, run: str = "") -> None:
        rr.set_strict_mode(True)  # else it only logs errors
        spec = view.scene
        self._start_ns = spec.start_ns
        agent = "" if view.is_ego else f"-{view.agent}"
        self._stream = rr.RecordingStream(
            APPLICATION, recording_id=f"{spec.name}{agent}-{spec.seed}{run}", batcher_config=_batches()
        )
        self._stream.send_recording_name(f"{spec.name}{agent}")
        self.size_bytes = 0

    def save(self, file: Path, blueprint: rr.blueprint.Blueprint) -> None:
        """Write everything that is logged from now on to a file."""
        self._stream.save(file, default_blueprint=blueprint)

    def connect(self, url: str, blueprint: rr.blueprint.Blueprint) -> None:
        """Send everything that is logged from now on to a server."""
        self._stream.connect_grpc(url, default_blueprint=blueprint)

    def begin(self, tick: int, stamp_ns: int) -> None:
        """Set the time of what is logged next."""
        self._stream.set_time(TIME, duration=(stamp_ns - self._start_ns) / NS_PER_S)
        self._stream.set_time(TICK, sequence=tick)

    def add(self, entity: str, archetype: Any) -> None:
        """Log the state of an entity at the present time."""
        self.size_bytes += sum(batch.as_arrow_array().nbytes for batch in archetype.as_component_batches())
        self._stream.log(entity, archetype)

    def add_static(self, entity: str, *archetypes: Any) -> None:
        """Log the state of an entity that does not change in time."""
        self._stream.log(entity, *archetypes, static=True)

    def flush(self) -> None:
        """Wait until everything has been written or sent."""
        self._stream.flush()

    def is_flushed(self, timeout_s: float) -> bool:
        """Wait until everything has been sent; return whether that took less than ``timeout_s`` seconds."""
        try:
            self._stream.flush(timeout_sec=timeout_s)
        except RuntimeError:  # the server is stalled, or has ended
            return False
        return True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        """Finish the file, or the connection; after an error without waiting until everything has been sent."""
        if kind is None:
            self.flush()
        self._stream.disconnect()
