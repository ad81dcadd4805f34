"""The tank: courses, bottoms, heads, solids, capacity, dips, deliveries, rules."""
