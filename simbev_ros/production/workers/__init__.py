"""Workers that make the scenes of a dataset side by side: in this process, in others, and on other machines."""
