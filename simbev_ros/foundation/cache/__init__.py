"""The cache on disk: content that is built once and then read by many processes, keyed by a fingerprint of its code."""
