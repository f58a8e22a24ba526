"""Thin ROS nodes: receive, call one pure function, convert, publish."""
