"""Contact sheets and videos of recorded scenes, drawn from a scene's bag."""
