"""What must be on a machine besides Python's packages, and what of it is missing."""
