"""The main job: from a checked job to the capacity table, step by step."""
