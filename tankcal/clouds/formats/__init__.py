"""Files of scanners, a module for each format: their headers checked, their points in pieces."""
