"""From the G-buffer to a color image: materials, rain, wet ground, screen passes."""
