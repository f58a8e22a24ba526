"""The commands ``simbev export coco``, ``kitti``, ``nuscenes``, ``opv2v`` and ``yolo``."""
