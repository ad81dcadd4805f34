"""Computation of many jobs, by dask workers or in this process (docs/batch.md).

`running.run_batch` runs a whole batch. The folder of each job, DIR/jobs/NAME, contains
`outcome.json`, from which an interrupted batch continues.
"""
