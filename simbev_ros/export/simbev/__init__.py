"""SimBEV's own layout, for training code that was written for it."""
