"""Comparison of software: tanks by lot, surveys of them, sealed truth, answers and their scores."""
