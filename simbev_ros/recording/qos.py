"""Quality of service of a recorded topic, in the words of rosbag2."""

from dataclasses import dataclass
from typing import Any, Literal

import yaml

FAST_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
"""That of the C library, where PyYAML has it."""

_INFINITE = {"sec": 9223372036, "nsec": 854775807}


@dataclass(frozen=True, slots=True)
class QosProfile:
    """What a publisher offers. Deadline, lifespan and liveliness lease are never limited."""

    reliability: Literal["reliable", "best_effort"] = "reliable"
    durability: Literal["volatile", "transient_local"] = "volatile"
    history: Literal["keep_last", "keep_all"] = "keep_last"
    depth: int = 10

    def as_mapping(self) -> dict[str, Any]:
        """Keys, order and values of rosbag2's metadata version 9."""
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
        """A list of this one profile, as the MCAP plugin of rosbag2 keeps it with a channel."""
        return str(yaml.dump([self.as_mapping()], Dumper=FAST_DUMPER, sort_keys=False)).strip()
