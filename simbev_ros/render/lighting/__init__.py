"""Light: sun, sky, clouds, lamps, shadows and exposure, as the shaders read them."""
