"""Light as the shaders read it: sun, sky, clouds, lamps, shadows and exposure."""
