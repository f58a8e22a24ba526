"""The system's libraries that the installed wheels need: derives the table that set-up and doctor read."""
