"""Traffic by SUMO: what goes into it, what comes out of it as arrays, and the streets that it needs."""
