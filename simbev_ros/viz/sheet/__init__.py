"""Contact sheets and videos of recorded scenes."""
