"""What does not fit, and why: gross errors, held control, misread files."""
