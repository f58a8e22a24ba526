"""OpenGL: the only package that imports moderngl."""
