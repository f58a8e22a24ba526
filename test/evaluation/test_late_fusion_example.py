"""The example of late fusion finds what one of the agents alone cannot see."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import cooperative_scene

from simbev_ros.dataset import open_dataset

EXAMPLE = Path(__file__).parents[2] / "examples/late_fusion.py"


def test_fused_boxes_find_what_is_hidden_from_one_agent(tmp_path: Path) -> None:
    spec = spec_from_file_location("late_fusion", EXAMPLE)
    assert spec is not None and spec.loader is not None
    example = module_from_spec(spec)
    spec.loader.exec_module(example)
    scenes = list(open_dataset(cooperative_scene.record(tmp_path / "cars")).scenes)
    assert [*example.compare(scenes, tmp_path)] == [
        f"{agent}: 40 boxes in the joint truth; found: alone 75.0%, fused 100.0%" for agent in ("ego", "car")
    ]
    assert sorted(path.name for path in tmp_path.glob("*.parquet")) == [
        f"{agent}-{kind}.parquet" for agent in ("car", "ego") for kind in ("alone", "fused")
    ]
