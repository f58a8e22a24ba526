"""A recorded scene as a sequence of frames, with its specification, calibration and tracks, read on demand.

A scene is read as one of its agents sees it: at first as the first agent, and by ``Scene.of_agent`` as any other.
"""

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property, partial
from typing import Any, overload

import numpy as np

from simbev_ros.dataset.calibration import Calibration
from simbev_ros.dataset.content import Content, SceneBags, Source, read_tracks
from simbev_ros.dataset.frame import Frame
from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.object_store.object_path import AnyPath
from simbev_ros.foundation.types import BoolArray, Int64Array
from simbev_ros.recording.mcap.chunk_cache import ChunkCache
from simbev_ros.schema.scene.agents import AgentView, agent_view, agent_views
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.schema.trajectories import Tracks


class Scene(Sequence[Frame]):
    """A recorded scene as one agent sees it: a sequence of frames, one per tick.

    The bag is opened on the first access that needs it.

    Args:
        cache: Cache of the bag's decompressed chunks.
        agent: Name of the agent; None: the ego.

    Attributes:
        path: The scene's bag.
        additional: Additional bags with the same motion, by label.
        row: The scene's row in the dataset's index; empty if it has none.
        chosen_agent: Name of the agent as given; None: the ego. It is known without opening the bag.
        threads: Number of threads that decode in ``Frame.load``; None: one for each core.
        may_be_cut_off: Whether the readable part of a truncated bag is read; otherwise it raises BagError.
    """

    def __init__(
        self,
        path: AnyPath,
        cache: ChunkCache,
        additional: Mapping[str, AnyPath] | None = None,
        row: Mapping[str, Any] | None = None,
        threads: int | None = None,
        *,
        may_be_cut_off: bool = False,
        agent: str | None = None,
    ) -> None:
        self.path, self.additional, self.row, self.threads = path, dict(additional or {}), dict(row or {}), threads
        self.may_be_cut_off, self._cache, self.chosen_agent = may_be_cut_off, cache, agent

    @property
    def name(self) -> str:
        """``<map>-<number>``."""
        return str(self.row["name"]) if self.row else self.spec.name

    @property
    def bag_name(self) -> str:
        """Name of the bag: that of its scene, with a label if it was replayed."""
        return self._bags.own.name

    @property
    def number(self) -> int:
        """The scene's number in the dataset."""
        return int(self.row["number"]) if self.row else self.spec.number

    @property
    def split(self) -> str:
        """``train``, ``val`` or ``test``."""
        return str(self.row["split"]) if self.row else self.spec.split

    @property
    def map(self) -> str:
        """Name of the scene's map."""
        return str(self.row["map"]) if self.row else self.spec.map.name

    @property
    def spec(self) -> SceneSpec:
        """Specification of the scene: everything that was drawn for it."""
        return self._bags.spec

    @cached_property
    def view(self) -> AgentView:
        """The scene as the agent sees it: the agent's rig, labels, frames and carrier.

        Raises:
            KeyError: The scene has no such agent.
        """
        return agent_view(self.spec, self.chosen_agent)

    @property
    def agent(self) -> str:
        """Name of the agent that the scene is read for."""
        return self.view.agent

    @property
    def agents(self) -> tuple[str, ...]:
        """Names of all agents of the scene, the ego's first."""
        return tuple(agent.name for agent in self.spec.agents)

    def of_agent(self, name: str) -> "Scene":
        """The same scene as another of its agents sees it; both share the opened bag and its cache.

        Raises:
            KeyError: The scene has no agent of this name.
        """
        if name not in self._of_agents:
            raise KeyError(f"{self.name}: no agent {name!r}; there are: {', '.join(self._of_agents)}")
        return self._of_agents[name]

    @property
    def weather(self) -> Weather:
        """Weather at the first tick; ``spec.weather_at`` gives it at the others."""
        return self.spec.weather

    @property
    def is_cut_off(self) -> bool:
        """Whether the bag was not closed by its writer."""
        return not self._bags.own.closed

    @property
    def stamps_ns(self) -> Int64Array:
        """(T,) stamps of the frames, ns."""
        return self._content.stamps_ns

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys that frames can have, sorted; the keys of slower sensors are not in every frame.

        Those of other agents begin with their names, as in ``car_2/lidar/points``.
        """
        return tuple(self.sources)

    @property
    def tick_ns(self) -> int:
        """Time from one frame to the next."""
        return self._content.tick_ns

    @property
    def sources(self) -> Mapping[str, Source]:
        """Topics that frames take their values from, by key, sorted."""
        return self._content.sources

    @property
    def calibration(self) -> Mapping[str, Calibration]:
        """Calibrations of the agent's sensors by name."""
        return self._content.calibration

    @cached_property
    def constants(self) -> Mapping[str, Any]:
        """Values published once for the whole scene, by key, such as ``world/map`` (OpenDRIVE) and ``world/legend``."""
        return {key: s.value(s.topic.locations) for key, s in self._content.constants.items() if len(s.topic.locations)}

    @cached_property
    def tracks(self) -> Tracks:
        """Tracks of all actors over the scene.

        Raises:
            BagError: The bag holds no tracks because it was not finished.
        """
        return read_tracks(self.path)

    def has(self, keys: Collection[str]) -> BoolArray:
        """(T,) whether each frame has all of the given keys."""
        edges_ns = np.append(self.stamps_ns[:1] - self.tick_ns, self.stamps_ns)
        found = np.ones(len(self), np.bool_)
        for key in keys:
            known = self.sources.get(key)
            stamps_ns = np.zeros(0, np.int64) if known is None else known.stamps_ns
            found &= np.diff(np.searchsorted(stamps_ns, edges_ns, side="right")) > 0
        return found

    def records(self, key: str) -> list[Mapping[str, Any]]:
        """All records of all frames under the key of a sporadic topic, such as ``world/events``.

        Raises:
            BagError: The bag is damaged, or one of them is not a JSON object.
        """
        found = [each for tick in np.flatnonzero(self.has([key])).tolist() for each in self[tick][key]]
        if not all(isinstance(each, dict) for each in found):
            raise BagError(f"{self.path}: {key}: not all records are JSON objects")
        return found

    def __len__(self) -> int:
        return int(self.row["recorded_ticks"]) if self.row else len(self.stamps_ns)

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [Frame(self, tick) for tick in range(len(self))[index]]
        return Frame(self, range(len(self))[index])

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the scene without anything that was read, so that it is small when it is sent to another process."""
        made = partial(Scene, may_be_cut_off=self.may_be_cut_off, agent=self.chosen_agent)
        return made, (self.path, self._cache, self.additional, self.row, self.threads)

    def __repr__(self) -> str:
        agent = "" if self.chosen_agent is None else f" of {self.chosen_agent}"
        return f"<scene {self.name}, {len(self)} frames{agent}>"

    @cached_property
    def _content(self) -> Content:
        return Content.from_bags(self._bags, self.view)

    @cached_property
    def _bags(self) -> SceneBags:
        return SceneBags.open(self.path, self.additional, self._cache, may_be_cut_off=self.may_be_cut_off)

    @cached_property
    def _of_agents(self) -> dict[str, "Scene"]:
        """The scene of each agent by name, this one among them."""
        scenes = {
            view.agent: self if view.agent == self.agent else self._of_view(view) for view in agent_views(self.spec)
        }
        for scene in scenes.values():
            scene._of_agents = scenes
        return scenes

    def _of_view(self, view: AgentView) -> "Scene":
        given = self.path, self._cache, self.additional, self.row, self.threads
        agent = None if view.is_ego else view.agent
        scene = Scene(*given, may_be_cut_off=self.may_be_cut_off, agent=agent)
        scene.view, scene._bags = view, self._bags
        return scene
