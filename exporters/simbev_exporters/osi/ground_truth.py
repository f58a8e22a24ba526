"""One ``osi3.GroundTruth`` for each tick of a scene, in the map frame.

A scene enters; messages in order of time leave. The first one alone has the lanes, which do not change.
"""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from osi3.osi_groundtruth_pb2 import GroundTruth
from osi3.osi_version_pb2 import DESCRIPTOR, current_interface_version

from simbev_exporters.osi.objects import ActorMessages
from simbev_exporters.osi.surroundings import environment, traffic_lights, traffic_signs
from simbev_ros.dataset import Frame, Scene
from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.units import NS_PER_S

if TYPE_CHECKING:
    from simbev_exporters.osi.lanes import MapMessages

_REQUIRED = "world/actors"


def true_ticks(scene: Scene) -> list[int]:
    """Ticks of which there is ground truth, those with actors.

    Raises:
        BagError: The bag is damaged, or no actors were recorded.
    """
    if _REQUIRED not in scene.sources or "world/legend" not in scene.constants:
        raise BagError(f"{scene.path}: no {_REQUIRED} or world/legend in it, of which ground truth is made")
    return list(map(int, np.flatnonzero(scene.has([_REQUIRED]))))


def ground_truths(scene: Scene, ticks: Sequence[int], roads: "MapMessages | None") -> Iterator[GroundTruth]:
    """The ground truth of each of the ``true_ticks``.

    Args:
        scene: The scene.
        ticks: The ticks.
        roads: Lanes of its map; None: they are left out.

    Raises:
        BagError: The bag is damaged.
    """
    legend = scene.constants["world/legend"]
    messages = ActorMessages(legend["blueprints"])
    opendrive_ids = [each["opendrive_id"] for each in legend["signals"]]
    for tick in ticks:
        truth = _dynamic(scene[tick], messages, opendrive_ids)
        if roads is not None:
            truth.proj_string = roads.proj_string
            if tick == ticks[0]:
                truth.lane.extend(roads.lanes)
                truth.lane_boundary.extend(roads.boundaries)
        yield truth


def osi_version() -> tuple[int, int, int]:
    """Version of OSI that messages have."""
    version = DESCRIPTOR.GetOptions().Extensions[current_interface_version]
    return version.version_major, version.version_minor, version.version_patch


def _dynamic(frame: Frame, messages: ActorMessages, opendrive_ids: list[str | None]) -> GroundTruth:
    actors, scene = frame[_REQUIRED], frame.scene
    truth = GroundTruth()
    truth.version.version_major, truth.version.version_minor, truth.version.version_patch = osi_version()
    truth.timestamp.seconds, truth.timestamp.nanos = divmod(frame.stamp_ns, NS_PER_S)
    if scene.view.vehicle is not None:
        truth.host_vehicle_id.value = scene.view.ego_id
    truth.map_reference = scene.map
    truth.moving_object.extend(messages.moving(actors))
    truth.stationary_object.extend(messages.stationary(actors))
    if "world/signals" in frame:
        signals = frame["world/signals"]
        known = opendrive_ids if len(opendrive_ids) == len(signals) else [None] * len(signals)
        truth.traffic_light.extend(traffic_lights(signals, known))
    if "boxes" in frame:
        truth.traffic_sign.extend(traffic_signs(frame["boxes"]))
    truth.environmental_conditions.CopyFrom(environment(scene.spec.weather_at(frame.tick), frame.stamp_ns))
    return truth
