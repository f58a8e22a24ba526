"""Data that training reads: arrays on disk that are mapped into memory, written once from a dataset."""
