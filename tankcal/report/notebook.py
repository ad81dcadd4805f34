"""The report's notebook: the templates joined, and executed by this very Python."""

import ast
import logging
import os
import sys
import tempfile
from pathlib import Path

import nbformat

from tankcal.errors import TankcalError, VocabularyError
from tankcal.text.shipped import shipped_folder

TEMPLATES = ("certificate.ipynb", "working_papers.ipynb", "field_table.ipynb")
CELL_TIMEOUT_S = 600
LONGEST_SOCKET = 90  # characters of a socket's path; systems end at 104 to 108


def joined(record_name, lacks=(), templates=TEMPLATES, **parameters):
    """One notebook from the shipped templates, to be kept beside the record of that name.

    parameters   other names of the templates' parameters cell, and their values

    Cells tagged "parameters" or "setup" are taken from the first template only. A cell tagged
    "if:courses" is left out when "courses" is among `lacks`, what the record has nothing of.

    Raises TankcalError for a parameter that the templates do not have.
    """
    folder = shipped_folder("report_templates")
    whole, *others = (nbformat.read(folder / name, as_version=4) for name in templates)
    for other in others:
        whole.cells += [c for c in other.cells if not _tags(c) & {"parameters", "setup"}]
    unneeded = {f"if:{part}" for part in lacks}
    whole.cells = [cell for cell in whole.cells if not _tags(cell) & unneeded]
    set_parameters(whole, {"RECORD": record_name, **parameters})
    for number, cell in enumerate(whole.cells, 1):
        cell.id = f"cell-{number}"
    return whole


def set_parameters(notebook, values):
    """Give the names in the cell tagged "parameters" their values; those not named keep theirs.

    Raises TankcalError when there is not one such cell, or when it has no such name.
    """
    cells = [cell for cell in notebook.cells if "parameters" in _tags(cell)]
    if len(cells) != 1:
        raise TankcalError(f"the notebook has {len(cells)} parameters cells, not one")
    known = {
        statement.targets[0].id: ast.literal_eval(statement.value)
        for statement in ast.parse(cells[0].source).body
    }
    unknown = sorted(set(values) - set(known))
    if unknown:
        raise TankcalError(
            f"the notebook has no parameter {', '.join(unknown)}; it has: {', '.join(known)}"
        )
    cells[0].source = "\n".join(f"{name} = {value!r}" for name, value in (known | values).items())


def _tags(cell):
    return set(cell.metadata.get("tags", []))


def execute(notebook, folder, on_cell=None):
    """Execute `notebook` in place, with `folder` as its working directory.

    on_cell   called with the number of cells done, after each

    The kernel is this interpreter itself, whatever kernels are installed; it needs neither network
    nor a home folder that can be written to. Raises TankcalError naming the cell that failed.
    """
    from nbclient import NotebookClient
    from nbclient.exceptions import CellExecutionError, CellTimeoutError

    def done(cell, cell_index, execute_reply):
        if on_cell:
            on_cell(cell_index + 1)

    with tempfile.TemporaryDirectory(prefix="tankcal-", ignore_cleanup_errors=True) as scratch:
        client = NotebookClient(
            notebook,
            km=_kernel_manager(scratch),
            timeout=CELL_TIMEOUT_S,
            record_timing=False,
            shutdown_kernel="immediate",
            on_cell_executed=done,
            resources={"metadata": {"path": str(folder)}},
        )
        try:
            client.execute(env=_environment(scratch), cleanup_kc=True)
        except CellExecutionError as error:
            if error.ename == VocabularyError.__name__:
                raise VocabularyError(error.evalue) from error
            raise TankcalError(
                f"the report stopped in {_failed_cell(notebook)}: {error.ename}: {error.evalue}"
            ) from error
        except (CellTimeoutError, RuntimeError) as error:  # a kernel that died or never started
            raise TankcalError(f"the report stopped: {error}") from error
    return notebook


def _kernel_manager(scratch):
    from jupyter_client.kernelspec import KernelSpec
    from jupyter_client.manager import AsyncKernelManager

    class ThisInterpreter(AsyncKernelManager):
        """Starts ipykernel in the Python that runs now; no kernel needs to be registered."""

        @property
        def kernel_spec(self):
            command = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
            quiet = ["--HistoryManager.enabled=False"]
            return KernelSpec(argv=command + quiet, display_name="Python 3", language="python")

    manager = ThisInterpreter(connection_file=str(Path(scratch) / "kernel.json"))
    socket = str(Path(scratch) / "kernel")
    if os.name == "posix" and len(socket) < LONGEST_SOCKET:
        manager.transport = "ipc"  # no port that another report might take at the same moment
        manager.ip = socket
    return manager


def _environment(scratch):
    """The kernel's environment: whatever it wants to write goes to the scratch folder."""
    environment = {
        **os.environ,
        "IPYTHONDIR": str(Path(scratch) / "ipython"),
        "JUPYTER_RUNTIME_DIR": str(scratch),
        "MPLCONFIGDIR": _matplotlib_folder(),
        "PYDEVD_DISABLE_FILE_VALIDATION": "1",
    }
    environment.pop("MPLBACKEND", None)
    return environment


def _matplotlib_folder():
    """Where matplotlib keeps its font cache: it finds a folder that it can write to."""
    logger = logging.getLogger("matplotlib")
    level = logger.level
    logger.setLevel(logging.ERROR)  # that it took a temporary one is nobody's concern
    try:
        import matplotlib

        return matplotlib.get_configdir()
    finally:
        logger.setLevel(level)


def _failed_cell(notebook):
    for number, cell in enumerate(notebook.cells, 1):
        if any(output.output_type == "error" for output in cell.get("outputs", [])):
            first_line = (cell.source.strip().splitlines() or [""])[0]
            return f"cell {number} ({first_line})"
    return "a cell"
