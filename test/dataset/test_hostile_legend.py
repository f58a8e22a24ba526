"""A legend of another form than ours is one line, not a traceback."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from simbev_ros.dataset.nuscenes.scene_taxonomy import SceneTaxonomy
from simbev_ros.export.simbev.channels import _boxes
from simbev_ros.foundation.errors import InputError
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.scene.state import SIGNAL_DTYPE

LEGENDS = ["text", 7, None, [], {}, {"blueprints": 7}, {"blueprints": [7]}, {"blueprints": [{}]}, {"blueprints": "ab"}]


@pytest.mark.parametrize("legend", LEGENDS)
def test_it_is_named(legend: Any) -> None:
    scene: Any = SimpleNamespace(path="a", constants={"world/legend": legend}, sources={"world/actors": 1})
    with pytest.raises(InputError, match=r"^a: /world/legend: cannot be read: "):
        SceneTaxonomy(scene)
    with pytest.raises(InputError, match=r"^a: /world/legend: cannot be read: "):
        _boxes(np.zeros(1, BOX_DTYPE), np.zeros(1, SIGNAL_DTYPE), legend, "a: /world/legend")
