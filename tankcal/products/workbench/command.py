"""`tankcal notebook` and `tankcal app`: a job as a notebook, with and without code."""

import argparse
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.terminal.showing import complain, prepare_for_small_work, say, speak
from tankcal.text.shipped import LANGUAGES
from tankcal.version import install_command

MOST_PORT = 65535


def add(commands):
    """Add the parsers of `tankcal notebook` and `tankcal app`."""
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
    app = commands.add_parser(
        "app",
        help="serve a job as a web page without code",
        description="Serve the notebook of a job as a web page without code (Voilà), for editing, "
        "computing and saving in a browser of this machine. Ctrl-C stops the server.",
    )
    _add_job(app)
    app.add_argument(
        "--address",
        metavar="ADDRESS",
        default="127.0.0.1",
        help="address of this machine to listen on (default: 127.0.0.1, not accessible from other "
        "machines)",
    )
    app.add_argument("--port", metavar="N", type=_port, help="port (default: any free port)")
    app.add_argument("--no-browser", action="store_true", help="do not open a browser")
    app.set_defaults(command=_app)


def _add_job(parser):
    parser.add_argument("job", metavar="JOB", help="a job folder, its job.toml, or a job workbook")
    parser.add_argument(
        "--language",
        choices=LANGUAGES,
        help="language of the notebook and its contents (default: language of the job)",
    )


def _port(text):
    if not (text.isascii() and text.isdigit() and 0 < int(text[:9]) <= MOST_PORT):
        raise argparse.ArgumentTypeError(argparse._("invalid int value: %r") % text)
    return int(text)


def _write_notebook(options, out):
    """Return the path of the notebook of a job, after writing it or keeping manual changes."""
    from tankcal.products.desk.draft import Draft, source_of
    from tankcal.products.workbench.serving import notebook_path, write_notebook
    from tankcal.terminal.input_language import read_job_language

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
    prepare_for_small_work()
    serving.open_lab(path)


def _app(options):
    from tankcal.products.workbench import serving

    if not serving.has_app():
        expected = message(
            "no_app",
            "Voilà is not installed; to install it: {command}",
            command=install_command("app"),
        )
        raise InputError(Problem("tankcal app", expected))
    path = _write_notebook(options, None)
    port = serving.free_port(options.address, options.port)
    token = ""
    if not serving.is_local(options.address):
        token = serving.new_token()
        complain(
            message(
                "app_is_open",
                "warning: every machine that can connect to {address} and has the token of this "
                "address can read, change and compute this job; the data are sent unencrypted",
                address=options.address,
            )
        )
    address = f"http://{options.address}:{port}/" + (f"?token={token}" if token else "")
    say(
        message(
            "app_address", "open {address} in a browser; Ctrl-C stops the server", address=address
        )
    )
    prepare_for_small_work()
    serving.serve_app(path, port, options.address, not options.no_browser, token)
