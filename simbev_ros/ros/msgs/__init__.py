"""Converts between arrays and ROS messages, and defines the names, types and QoS of all topics."""
