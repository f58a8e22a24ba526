"""Names in a namespace, parameters, arguments and diagnostics, as ROS's own tools expect them of every node."""
