"""Plans of bare walls (strapping, lines, hits, tangents, liquid) and their predictions."""
