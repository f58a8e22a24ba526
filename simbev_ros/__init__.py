"""simbev_ros: random driving scenes as a ROS 2 graph, with sensors and exact bird's-eye-view ground truth."""

__version__ = "0.1.0"
