"""Export to the layout of KITTI's object detection: images, lidar clouds, calibration and labels."""
