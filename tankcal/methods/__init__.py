"""Ways of measuring the wall of a tank: a package for each (docs/house.md, "Methods")."""
