"""`tankcal notebook`: a job as a notebook."""

from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.terminal import complain, say, speak
from tankcal.text.shipped import LANGUAGES
from tankcal.version import install_command


def add(commands):
    """Add the parser of `tankcal notebook`."""
    notebook = commands.add_parser(
        "notebook",
        help="edit, check and compute a job in a notebook",
        description="Write a notebook for the job and open it in JupyterLab. It contains the "
        "tables as grids, checked during input, a button for the computation, and the results. A "
        "notebook with manual changes is kept.",
    )
    _add_job(notebook)
    notebook.add_argument(
        "--out",
        metavar="FILE",
        help="the notebook to write (default: tankcal.ipynb in the folder of the job, or "
        "NAME.ipynb beside NAME.xlsx)",
    )
    notebook.add_argument(
        "--no-open", action="store_true", help="write the notebook without opening it"
    )
    notebook.set_defaults(command=_notebook)


def _add_job(parser):
    parser.add_argument("job", metavar="JOB", help="a job folder, its job.toml, or a job workbook")
    parser.add_argument(
        "--language",
        choices=LANGUAGES,
        help="language of the notebook and its contents (default: language of the job)",
    )


def _write_notebook(options, out):
    """Return the path of the notebook of a job, after writing it or keeping manual changes."""
    from tankcal.products.desk.draft import Draft, source_of
    from tankcal.products.workbench.serving import notebook_path, write_notebook
    from tankcal.terminal import read_job_language

    language = options.language or read_job_language(options.job)
    if language is not None:
        speak(language)
    source = source_of(options.job)
    path = Path(out) if out is not None else notebook_path(source)
    if path.suffix.lower() != ".ipynb" or path.is_dir():
        expected = message("name_of_notebook", "expected the name of a notebook (.ipynb)")
        raise InputError(Problem("--out", expected))
    if write_notebook(source, path, options.language):
        say(message("wrote_notebook", "notebook: {file}", file=str(path)))
    else:
        text = message(
            "kept_notebook",
            "notebook: {file} contains manual changes and is kept; --out FILE writes a new "
            "notebook",
            file=str(path),
        )
        say(text)
    for problem in Draft(source).unreadable:
        complain(problem.text)
    return path


def _notebook(options):
    from tankcal.products.workbench import serving

    path = _write_notebook(options, options.out)
    if options.no_open:
        return
    if not serving.has_lab():
        complain(
            message(
                "no_lab",
                "JupyterLab is not installed; the notebook also opens in any other Jupyter. To "
                "install JupyterLab with the grids: {command}",
                command=install_command("lab"),
            )
        )
        return
    serving.open_lab(path)
