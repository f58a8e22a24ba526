"""Plants: how they are grown, which species a landscape has, and stocks of them to plant from."""
