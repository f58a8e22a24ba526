"""What a scene is: its drawn specification, its state at a tick, and how it is drawn."""
