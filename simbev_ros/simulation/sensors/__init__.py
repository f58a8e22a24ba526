"""Sensor models (lidar, radar, IMU, GNSS) as pure functions of the world state, without ROS."""
