"""What ROS's own tools expect of every node: names in a namespace, parameters with values, arguments, diagnostics."""
