"""The workbench: a job edited, checked and computed in a notebook (docs/notebook.md)."""
