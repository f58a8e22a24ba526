"""Ground-truth 3D boxes of actors, traffic lights and signs, and the sensor points inside them."""
