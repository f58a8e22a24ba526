"""Reports of evaluations as single HTML pages, and the SVG pictures on them."""
