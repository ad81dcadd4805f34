"""Checks of a plan: its input, the positions of its items, and the visibility of its targets."""
