"""Reads the CAN bus messages of all scenes with the nuscenes-devkit. Run by its own Python: DATAROOT FILE → JSON."""

import json
import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import numpy as np
from nuscenes import NuScenes
from nuscenes.can_bus.can_bus_api import NuScenesCanBus


def main(dataroot: str, file: str) -> None:
    """Write for each scene the number of messages, and how far poses are from those of the tables."""
    nusc = NuScenes(version="v1.0-trainval", dataroot=dataroot, verbose=False)
    buses, found = NuScenesCanBus(dataroot=dataroot), {}
    for scene in nusc.scene:
        poses = buses.get_messages(scene["name"], "pose")
        position_m = {pose["utime"]: np.array(pose["pos"]) for pose in poses}
        sample, offsets_m = nusc.get("sample", scene["first_sample_token"]), []
        while True:
            data = nusc.get("sample_data", next(iter(sample["data"].values())))
            pose = nusc.get("ego_pose", data["ego_pose_token"])
            offsets_m.append(np.linalg.norm(position_m[pose["timestamp"]] - pose["translation"]))
            if not sample["next"]:
                break
            sample = nusc.get("sample", sample["next"])
        buses.plot_message_data(scene["name"], "vehicle_monitor", "vehicle_speed")
        meta = buses.get_messages(scene["name"], "meta")
        found[scene["name"]] = {"poses": len(poses), "offset_m": float(max(offsets_m)), "meta": sorted(meta)}
    Path(file).write_text(json.dumps(found))


main(*sys.argv[1:])
