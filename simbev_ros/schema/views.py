"""Table of the objects that a camera sees."""

from simbev_ros.schema.messages.message_rows import row_dtype

VIEW_DTYPE = row_dtype("View")
"""Row of /ego/<camera>/boxes, an object that the camera would see alone; ``interfaces/msg/View.msg`` has its columns.

The canvas, which cuts silhouettes off, is the image with a margin of its own size on every side: columns
-width … 2 width - 1, rows -height … 2 height - 1. Nothing nearer than the near plane (0.1 m along the optical axis)
belongs to a silhouette or appears in images.
"""
