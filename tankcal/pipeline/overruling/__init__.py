"""Manual decisions against the outlier search: their effect on points and on the result."""
