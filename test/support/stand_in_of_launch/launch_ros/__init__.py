"""What our launch files need of ROS's package ``launch_ros``, as its API is in Jazzy."""
