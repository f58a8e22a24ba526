"""Pictures from the street of a map, rendered directly, without a ROS graph."""
