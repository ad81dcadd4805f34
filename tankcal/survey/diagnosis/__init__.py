"""Diagnosis of a survey that does not fit: gross errors, held control, misread files."""
