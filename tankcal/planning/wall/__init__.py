"""Plans of walls that are strapped, read from reference lines or hit: the job, foreseen."""
