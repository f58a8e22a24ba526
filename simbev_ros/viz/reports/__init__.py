"""Reports as single HTML pages: datasets and evaluations, with charts as SVG."""
