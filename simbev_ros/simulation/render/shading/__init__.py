"""Shading: turns the G-buffer into a color image, with materials, rain, wet ground and screen passes."""
