"""Wrappers around OpenGL: contexts, devices, programs, render targets and read-back."""
