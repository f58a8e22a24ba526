"""The contract between the side that makes data and the side that reads it: tables and scenes."""
