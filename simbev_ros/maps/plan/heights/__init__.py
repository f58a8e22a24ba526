"""Heights of planned roads: a quadratic program within grades, vertical curves and clearances."""
