"""Playing scenes and making datasets from Python, without a console.

>>> from simbev_ros.production import make_dataset
>>> result = make_dataset("my.yaml", "datasets/first")
>>> result.is_complete
True
"""

from typing import TYPE_CHECKING

from simbev_ros.foundation.lazy import lazy_names

if TYPE_CHECKING:
    from simbev_ros.production.dataset import DatasetResult, make_dataset
    from simbev_ros.production.observer import ProductionObserver
    from simbev_ros.production.play import play_scenes
    from simbev_ros.production.replay.replays import ReplayResult, replay_bags

__all__ = ["DatasetResult", "ProductionObserver", "ReplayResult", "make_dataset", "play_scenes", "replay_bags"]
__getattr__ = lazy_names(
    __name__,
    {
        "DatasetResult": "dataset",
        "ProductionObserver": "observer",
        "ReplayResult": "replay.replays",
        "make_dataset": "dataset",
        "play_scenes": "play",
        "replay_bags": "replay.replays",
    },
)
