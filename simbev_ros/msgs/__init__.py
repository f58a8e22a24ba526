"""Conversion between arrays and ROS messages, and the names, types and QoS of all topics."""
