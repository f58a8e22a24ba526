"""Reports of datasets and evaluations as single HTML pages with SVG charts."""
