"""Pure sensor models: world state in, samples out."""
