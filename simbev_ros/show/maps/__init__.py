"""Pictures of maps: plan drawings and orthophotos."""
