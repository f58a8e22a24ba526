"""Pictures and video of recorded scenes."""
