"""Comparison and history of capacity tables of one tank, and the tank geometry behind a table."""
