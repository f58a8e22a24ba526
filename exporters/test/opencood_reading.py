"""Opens an export with OpenCOOD's data set for early fusion. Run by its own Python: FOLDER → JSON, a record a frame.

The package on PyPI, opencoodx 0.1.19, imports spconv and an old Matplotlib, of which reading uses nothing.
"""

import json
import sys
from pathlib import Path
from unittest.mock import MagicMock

import matplotlib
import numpy as np

for name in ("cumm", "cumm.tensorview", "spconv", "spconv.utils", "spconv.pytorch", "spconv.pytorch.utils"):
    sys.modules[name] = MagicMock()
matplotlib.cm.get_cmap = matplotlib.colormaps.get_cmap

import opencood  # noqa: E402
from opencood.data_utils.datasets.early_fusion_dataset import EarlyFusionDataset  # noqa: E402
from opencood.hypes_yaml.yaml_utils import load_yaml  # noqa: E402
from opencood.utils.transformation_utils import x1_to_x2  # noqa: E402


def main(folder: str) -> None:
    """Write who is the ego, each agent's points in the ego's lidar frame (their mean), and the centers of boxes."""
    settings = load_yaml(str(Path(opencood.__file__).with_name("hypes_yaml") / "voxelnet_early_fusion.yaml"))
    settings |= {"root_dir": folder, "validate_dir": folder, "data_augment": []}
    settings["preprocess"]["core_method"] = "BasePreprocessor"
    settings["preprocess"]["args"]["sample_num"] = 100
    dataset = EarlyFusionDataset(settings, visualize=True, train=False)
    frames = []
    for index in range(len(dataset)):
        agents, fused = dataset.retrieve_base_data(index), dataset[index]["ego"]
        (ego,) = (name for name, agent in agents.items() if agent["ego"])
        means = {}
        for name, agent in agents.items():
            ego_from_lidar = x1_to_x2(agent["params"]["lidar_pose"], agents[ego]["params"]["lidar_pose"])
            points = agent["lidar_np"][:, :3] @ ego_from_lidar[:3, :3].T + ego_from_lidar[:3, 3]
            means[name] = np.mean(points, axis=0).tolist()
        centers = fused["object_bbx_center"][fused["object_bbx_mask"] > 0, :3].tolist()
        frames.append({"ego": ego, "means": means, "centers": dict(zip(fused["object_ids"], centers, strict=True))})
    print(json.dumps(frames))


main(*sys.argv[1:])
