"""Fail when a notebook in the given folders is committed with outputs; strip them with --fix."""

import sys
from pathlib import Path

import nbformat


def main(arguments):
    """Exit status 1 when a notebook has outputs and --fix was not given."""
    fix = "--fix" in arguments
    dirty = []
    for folder in (name for name in arguments if name != "--fix"):
        for path in sorted(Path(folder).rglob("*.ipynb")):
            if "results" in path.parts:  # what a notebook here made
                continue
            notebook = nbformat.read(path, as_version=4)
            code = [cell for cell in notebook.cells if cell.cell_type == "code"]
            if any(cell.outputs or cell.execution_count for cell in code):
                dirty.append(path)
                for cell in code:
                    cell.outputs, cell.execution_count = [], None
                if fix:
                    nbformat.write(notebook, path)
    for path in dirty:
        print(f"{path}: {'stripped' if fix else 'has outputs; strip them with --fix'}")
    return 1 if dirty and not fix else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
