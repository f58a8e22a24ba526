"""OpenGL itself: contexts, devices, programs, render targets and reading back."""
