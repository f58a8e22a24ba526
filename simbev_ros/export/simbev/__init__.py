"""Export to the layout of SimBEV, for training code that was written for it."""
