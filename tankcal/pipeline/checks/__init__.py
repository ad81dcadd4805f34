"""Warnings about a survey: agreement of readings, sizes, set-ups, the wall and its noise."""
