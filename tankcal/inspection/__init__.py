"""Inspection by the same survey: plumbness, roundness, peaking, settlement, each with its U."""
