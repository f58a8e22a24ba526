"""Pictures from the street, rendered without a graph."""
