"""How far sensor data are from those of real sensors: statistics of both, side by side."""
