"""A scene as nuScenes sees it: its channels, keyframes, categories and attributes, for exports and for metrics."""
