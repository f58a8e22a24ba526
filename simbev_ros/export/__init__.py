"""Datasets in the layouts of others. Needs neither ROS nor a graphics card."""
