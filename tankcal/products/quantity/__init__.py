"""From a dip to the quantity of product: volumes at the base temperature, mass, and their U."""
