"""Pictures of maps: plans and views from above."""
