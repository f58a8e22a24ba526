"""OpenGL rendering: turns world states into camera images. The only package that imports moderngl.

Shared by all cameras of a frame: the table of rigid parts, the shadow map, the lamp field and the contact map. Per
camera, one geometry pass fills a G-buffer. Depth is read from it; semantic, instance and flow images are computed from
it; RGB is shaded from it by one shader per class of materials, then anti-aliased. Labels are never smoothed.
"""
