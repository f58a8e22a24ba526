"""Table of the objects that a camera sees."""

import numpy as np

VIEW_DTYPE = np.dtype(
    [
        ("id", "<u4"),
        ("visible_px", "<u4"),  # pixels of the instance image that show the object
        ("alone_px", "<u4"),  # pixels it would have alone in the world; at least 1 and at least visible_px
        ("visibility", "<f4"),  # visible_px / alone_px
        ("truncation", "<f4"),  # share of the object's silhouette on the canvas that is outside the image
        ("left", "<f4"),  # pixels, box around the visible pixels; NaN where nothing is visible
        ("top", "<f4"),
        ("right", "<f4"),
        ("bottom", "<f4"),
        ("amodal_left", "<f4"),  # box around the whole silhouette, occluded or not, up to the canvas borders
        ("amodal_top", "<f4"),
        ("amodal_right", "<f4"),
        ("amodal_bottom", "<f4"),
        ("class", "u1"),  # index into BOX_CLASSES
    ]
)
"""Row of the table of objects that a camera would see if they were alone; fields as in /ego/<camera>/boxes.

Pixel centers are at integers: the box around the single pixel in column 7 and row 3 is 6.5, 2.5, 7.5, 3.5.
The canvas is the image with a margin of its own size on every side: columns -width … 2 width - 1, rows -height … 2
height - 1. Nothing nearer than the near plane (0.1 m along the optical axis) belongs to a silhouette or appears in
images.
"""
