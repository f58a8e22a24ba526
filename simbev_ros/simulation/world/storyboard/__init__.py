"""The OpenSCENARIO engine: a storyboard moves the entities of a scene, tick by tick."""
