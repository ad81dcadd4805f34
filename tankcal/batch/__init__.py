"""Many jobs: what is asked of each, by workers of dask or in this process (docs/batch.md).

`running.run_batch` is the whole; each job has a folder of its own under DIR/jobs with an
`outcome.json`, by which a batch that was ended in the middle goes on.
"""
