"""Tables for gauging and inventory systems: profiles, breakpoints, files that are read back."""
