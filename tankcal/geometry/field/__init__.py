"""The wall of a tank as one random field."""
