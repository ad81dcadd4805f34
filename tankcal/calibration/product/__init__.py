"""Accuracy of a product from check points, compared with a table of limits."""
