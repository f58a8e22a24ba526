"""Export to the layout of nuScenes, which the nuscenes-devkit can open."""
