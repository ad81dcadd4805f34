"""Is a product good enough? Check points against a table of limits."""
