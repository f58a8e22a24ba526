"""OpenGL: from world states to camera images. The only package that imports moderngl.

Per frame: the table of rigid parts, shadow map, lamp field and contact map, which all cameras share. Per camera: one
geometry pass fills a G-buffer; depth is read from it, semantic, instance and flow are computed from it, and RGB is
shaded from it by one shader per class of materials, then anti-aliased. Labels are never smoothed.
"""
