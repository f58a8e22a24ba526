"""The commands ``simbev export autoware``, ``coco``, ``kitti``, ``nuscenes``, ``opv2v``, ``osi``, ``t4``, ``yolo``."""
