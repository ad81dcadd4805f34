"""Show the notebook in JupyterLab, or in Voilà without its code."""

import ipaddress
import os
import secrets
import socket
from contextlib import suppress
from importlib.util import find_spec

from tankcal.errors import InputError, Problem, reason_of
from tankcal.messages import message

HERE = "127.0.0.1"  # address that only this machine can reach
# The page loads nothing from other hosts, and sends the messages of its kernel to no other host.
# The template of Voilà refers to a style sheet on another host; a machine without a network would
# wait for it.
POLICY = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob: ws: wss:; frame-ancestors 'self'"
)
# Voilà refuses the request of a closed page to end its kernel, so that idle kernels must be ended.
# A running computation reports its progress and is not idle.
IDLE_S, CHECK_S = 600, 60  # idle time after which a kernel is ended, and interval of the check


def has_lab():
    """Whether JupyterLab and the widgets of the grids are installed."""
    return all(map(find_spec, ("jupyterlab", "ipywidgets", "anywidget")))


def has_app():
    """Whether Voilà and the widgets of the grids are installed."""
    return all(map(find_spec, ("voila", "ipywidgets", "anywidget")))


def open_lab(notebook, is_browser=True):
    """Show a notebook in JupyterLab, on this machine only, until JupyterLab is stopped."""
    from jupyterlab.labapp import LabApp

    _speed_up_kernels()
    arguments = [str(notebook), f"--ServerApp.ip={HERE}", "--ServerApp.answer_yes=True"]
    LabApp.launch_instance(arguments if is_browser else [*arguments, "--no-browser"])


def serve_app(notebook, port, address=HERE, is_browser=True, token=""):
    """Serve a notebook by Voilà, without its code, until Voilà is stopped.

    Parameters
    ----------
    notebook : Path
        The notebook.
    port : int
        Port of the server.
    address : str
        Address of the server.
    is_browser : bool
        Whether to open a browser.
    token : str
        Token that a visitor requires; "" for no token.
    """
    from traitlets.config import Config
    from voila.app import Voila

    _speed_up_kernels()
    arguments = [
        str(notebook),
        f"--Voila.ip={address}",
        f"--port={port}",
        f"--Voila.open_browser={bool(is_browser)}",
        f"--token={token}",
        "--strip_sources=True",
    ]
    headers = {"Content-Security-Policy": POLICY}
    idle_settings = {"cull_idle_timeout": IDLE_S, "cull_interval": CHECK_S, "cull_connected": False}
    # A local address requires no token. A web page whose host name resolves to this machine (DNS
    # rebinding) must not reach the kernel, so that other host names are refused.
    tornado = {"headers": headers, "allow_remote_access": not is_local(address)}
    settings = Config(
        {"Voila": {"tornado_settings": tornado}, "MappingKernelManager": idle_settings}
    )
    Voila.launch_instance(arguments, config=settings)


def is_local(address):
    """Whether only this machine can reach the address."""
    with suppress(ValueError):
        return ipaddress.ip_address(address).is_loopback
    return address == "localhost"


def new_token():
    """New random token for access to a server."""
    return secrets.token_urlsafe(18)


def free_port(address, wanted=None):
    """Return the wanted port or a free port; InputError if address or port is unavailable."""
    try:
        family = socket.getaddrinfo(address, wanted or 0, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family, socket.SOCK_STREAM) as connection:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            connection.bind((address, wanted or 0))
            return connection.getsockname()[1]
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


def _speed_up_kernels():
    """Set environment variables for kernels; several BLAS threads are slow for small matrices."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("PYDEVD_DISABLE_FILE_VALIDATION", "1")
