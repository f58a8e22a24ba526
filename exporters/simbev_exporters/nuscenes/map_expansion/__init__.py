"""Export of road networks to the layout of nuScenes' map expansion."""
