"""rosbag2 bags of scenes in MCAP files: writing, reading, metadata, verification, repair and replay."""
