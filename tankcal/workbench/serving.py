"""Programs of others that show the notebook: JupyterLab, and Voilà without the code."""

import ipaddress
import os
import secrets
import socket
from contextlib import suppress
from importlib.util import find_spec

from tankcal.errors import InputError, Problem, reason_of
from tankcal.messages import message

HERE = "127.0.0.1"
# The page takes nothing from elsewhere, and its kernel's messages go nowhere else: the template of
# Voilà names a style sheet of another host, which a machine without a network would wait for.
POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob: ws: wss:; frame-ancestors 'self'"
)
# Voilà refuses the request of a closed page to end its kernel: each visit would keep one.
# A run that goes on tells its progress, and is let finish.
LEFT_S, LOOK_S = 600, 60  # nobody looks on and nothing is computed; how often that is looked for


def has_lab():
    """Is JupyterLab installed, with the widgets of the grids?"""
    return all(map(find_spec, ("jupyterlab", "ipywidgets", "anywidget")))


def has_app():
    """Is Voilà installed, with the widgets of the grids?"""
    return all(map(find_spec, ("voila", "ipywidgets", "anywidget")))


def open_lab(notebook, is_browser=True):
    """Show a notebook in JupyterLab, on this machine alone, until it is stopped."""
    from jupyterlab.labapp import LabApp

    _let_kernels_start_quickly()
    given = [str(notebook), f"--ServerApp.ip={HERE}", "--ServerApp.answer_yes=True"]
    LabApp.launch_instance(given if is_browser else [*given, "--no-browser"])


def serve_app(notebook, port, address=HERE, is_browser=True, token=""):
    """Serve a notebook by Voilà, without its code, until it is stopped.

    Parameters
    ----------
    notebook : Path
    port : int
    address : str
        That it listens on.
    is_browser : bool
        Open it in a browser.
    token : str
        That a visitor must bring; "": none.
    """
    from traitlets.config import Config
    from voila.app import Voila

    _let_kernels_start_quickly()
    given = [
        str(notebook),
        f"--Voila.ip={address}",
        f"--port={port}",
        f"--Voila.open_browser={bool(is_browser)}",
        f"--token={token}",
        "--strip_sources=True",
    ]
    headers = {"Content-Security-Policy": POLICY}
    left = {"cull_idle_timeout": LEFT_S, "cull_interval": LOOK_S, "cull_connected": False}
    # On an address of this machine alone there is no token. A web page whose host name resolves to
    # this machine (DNS rebinding) must not reach the kernel: other host names are refused.
    tornado = {"headers": headers, "allow_remote_access": not is_local(address)}
    settings = Config({"Voila": {"tornado_settings": tornado}, "MappingKernelManager": left})
    Voila.launch_instance(given, config=settings)


def is_local(address):
    """Is it an address that this machine alone can reach?"""
    with suppress(ValueError):
        return ipaddress.ip_address(address).is_loopback
    return address == "localhost"


def new_token():
    """A word that nobody guesses."""
    return secrets.token_urlsafe(18)


def free_port(address, wanted=None):
    """The port asked for, or any that is free; InputError where the address or port is not ours."""
    try:
        family = socket.getaddrinfo(address, wanted or 0, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family, socket.SOCK_STREAM) as tried:
            tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            tried.bind((address, wanted or 0))
            return tried.getsockname()[1]
    except (OSError, OverflowError, UnicodeError) as error:
        reason = reason_of(error)
        expected = message(
            "address_not_free",
            "cannot listen on port {port} of {address} ({reason})",
            port=str(wanted or 0),
            address=address,
            reason=reason,
        )
        raise InputError(Problem("--port" if wanted else "--address", expected)) from error


def _let_kernels_start_quickly():
    """As the command line does: a second BLAS thread costs time with small matrices."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("PYDEVD_DISABLE_FILE_VALIDATION", "1")
