"""The referee's rules; each judges one tick after the other."""
