"""The life of a table: what a former one says of its tank, and what has changed since."""
