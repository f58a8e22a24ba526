"""The lanes of an exact map as a graph of edges and connections, and the SUMO net that is made from it."""
