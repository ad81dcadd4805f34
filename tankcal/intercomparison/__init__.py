"""Comparison of software: random tanks, simulated surveys, sealed volumes, answers and scores."""
