"""Export to the layout of OPV2V, a data set of cooperative perception, which OpenCOOD reads."""
