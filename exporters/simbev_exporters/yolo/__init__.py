"""Export to the layout of YOLO, with boxes or outlines of objects, which ultralytics reads."""
