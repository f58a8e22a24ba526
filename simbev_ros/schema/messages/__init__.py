"""Message types of bags: those of ROS 2 Jazzy and of this project, their definitions, and tables as messages."""
