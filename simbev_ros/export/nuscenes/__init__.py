"""nuScenes' layout, as the nuscenes-devkit opens it."""
