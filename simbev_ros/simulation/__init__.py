"""The simulated world and what is sensed of it: traffic, rendering, ray casting, sensors, labels. No ROS."""
