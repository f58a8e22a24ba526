"""A rule-based planner for a drive along a route: numpy alone, without ROS."""
