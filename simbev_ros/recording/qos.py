"""Quality of service of a recorded topic, in rosbag2's notation."""

from dataclasses import dataclass
from typing import Any, Literal

import yaml

FAST_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
"""YAML dumper of the C library if PyYAML was built with it, else the Python one."""

_INFINITE = {"sec": 9223372036, "nsec": 854775807}


@dataclass(frozen=True, slots=True)
class QosProfile:
    """Quality of service that a publisher offers; deadline, lifespan and liveliness lease are always infinite."""

    reliability: Literal["reliable", "best_effort"] = "reliable"
    durability: Literal["volatile", "transient_local"] = "volatile"
    history: Literal["keep_last", "keep_all"] = "keep_last"
    depth: int = 10

    def as_mapping(self) -> dict[str, Any]:
        """The profile with the keys, order and values of rosbag2's metadata version 9."""
        return {
            "history": self.history,
            "depth": self.depth,
            "reliability": self.reliability,
            "durability": self.durability,
            "deadline": dict(_INFINITE),
            "lifespan": dict(_INFINITE),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_INFINITE),
            "avoid_ros_namespace_conventions": False,
        }

    def as_yaml(self) -> str:
        """YAML list with this profile only, as rosbag2's MCAP plugin stores it with a channel."""
        return str(yaml.dump([self.as_mapping()], Dumper=FAST_DUMPER, sort_keys=False)).strip()
