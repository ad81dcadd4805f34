"""Products: commands beside the main job, each in its own package."""
