"""Start of the app: address, token, and the running app of this user."""

import json
import os
import socket
import threading
import webbrowser
from contextlib import suppress
from pathlib import Path

from tankcal.errors import InputError, Problem, reason_of
from tankcal.messages import message
from tankcal.products.app.access import Guard, People, new_token
from tankcal.products.app.server import make_application
from tankcal.products.app.site import Site
from tankcal.products.desk.jobs import find_state_folder

HERE = "127.0.0.1"  # address that only this machine can reach
LOCAL_NAMES = ("127.0.0.1", "localhost", "[::1]")
STATE_FILE = "app.json"  # address and process of the running app
PORT_FILE = "port"  # last port, so that open pages find a restarted app
GRACE_S = 1  # time that open event streams get at the end


def free_socket(address, port=0):
    """Bind a socket to an address; InputError if address or port is unavailable."""
    try:
        info = socket.getaddrinfo(address, port or 0, type=socket.SOCK_STREAM)[0]
        bound = socket.socket(info[0], socket.SOCK_STREAM)
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind((address, port or 0))
        bound.listen()  # a browser that is opened before the server answers then waits
    except (OSError, OverflowError, UnicodeError) as error:
        reason = reason_of(error)
        expected = message(
            "address_not_free",
            "cannot listen on port {port} of {address} ({reason})",
            port=str(port or 0),
            address=address,
            reason=reason,
        )
        raise InputError(Problem("--port" if port else "--address", expected)) from error
    bound.set_inheritable(True)
    return bound


def last_socket(address, folder):
    """Bind the last port of the app of this user unless it is in use, else any free port."""
    with suppress(OSError, ValueError, InputError):
        port = int((folder / PORT_FILE).read_text())
        with socket.socket() as trial:
            trial.settimeout(1)
            if trial.connect_ex((address, port)):
                return free_socket(address, port)
    return free_socket(address)


def default_workspace():
    """Folder of new jobs: `tankcal` in the documents of the user."""
    home = Path.home()
    names = ("Documents", "Documentos")
    documents = next((home / name for name in names if (home / name).is_dir()), home)
    return documents / "tankcal"


def guard_application(site, port, token, hosts, base="", is_secure=False):
    """Application with its guard.

    Parameters
    ----------
    site : Site
        Jobs and folders.
    port : int
        Port of the server.
    token : str
        Token.
    hosts : iterable of str
        Names of the host, without the port, or with the port of a proxy.
    base : str
        Prefix of all addresses.
    is_secure : bool
        Whether the browser uses TLS.
    """
    names = {name if ":" in name.strip("[]") else f"{name}:{port}" for name in hosts}
    names |= {f"{name}:{port}" for name in hosts} | ({*hosts} if is_secure else set())
    application = make_application(site, base)
    return Guard(application, names, token, f"tankcal-{port}", is_secure, site.people, base)


def write_state(folder, address):
    """Write address and process of the running app, readable only by this user."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / STATE_FILE
    with suppress(OSError):
        path.unlink()
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        json.dump({"address": address, "process": os.getpid()}, file)
    (folder / PORT_FILE).write_text(address.split("/")[2].rpartition(":")[2])
    return path


def running_address(folder=None):
    """Address with the token of the app that this user has running, or None."""
    try:
        path = Path(folder or find_state_folder()) / STATE_FILE
        content = json.loads(path.read_bytes())
        host, port = content["address"].split("/")[2].rsplit(":", 1)
        with socket.create_connection((host.strip("[]"), int(port)), 1):
            return content["address"]
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        pass
    return None


def serve(bound, application, state_file, certificate=None, key=None):
    """Serve an application on a bound socket until Ctrl-C."""
    import uvicorn

    config = uvicorn.Config(
        application, log_level="warning", access_log=False, lifespan="off", ws="none",
        timeout_graceful_shutdown=GRACE_S, server_header=False, ssl_certfile=certificate,
        ssl_keyfile=key,
    )  # fmt: skip
    server = uvicorn.Server(config)
    try:
        server.run(sockets=[bound])
    except KeyboardInterrupt:
        pass
    finally:
        with suppress(OSError):
            if state_file is not None:
                state_file.unlink()


def open_browser(address):
    """Open a browser; without a browser, the printed address remains."""
    with suppress(Exception):
        webbrowser.open(address)


def open_browser_meanwhile(address):
    """Open a browser while the server starts: some browsers return only when they are closed."""
    threading.Thread(target=open_browser, args=(address,), daemon=True).start()


__all__ = [
    "HERE",
    "LOCAL_NAMES",
    "People",
    "Site",
    "default_workspace",
    "find_state_folder",
    "free_socket",
    "guard_application",
    "last_socket",
    "new_token",
    "open_browser",
    "open_browser_meanwhile",
    "running_address",
    "serve",
    "write_state",
]
