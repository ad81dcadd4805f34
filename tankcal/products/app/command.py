"""`tankcal app`: from a new job to its certificate in a browser."""

import argparse
import getpass
import socket
import sys
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.app.people import ROLES
from tankcal.terminal.showing import language_of_run, prepare_for_small_work, say, speak
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words

MOST_PORT = 65535


def add(commands):
    """Add the parser of `tankcal app`."""
    app = commands.add_parser(
        "app",
        help="open tankcal in a browser, without a terminal",
        description="Show pages in a browser of this machine to create tanks, import and edit "
        "measurements, compute, and read the certificate. Ctrl-C stops the server.",
    )
    app.add_argument(
        "job",
        metavar="JOB",
        nargs="?",
        help="a job folder, its job.toml, or a job workbook to open (default: list of recent jobs)",
    )
    app.add_argument(
        "--language", choices=LANGUAGES, help="language of the pages (default: of the browser)"
    )
    app.add_argument(
        "--workspace",
        metavar="DIR",
        help="folder of new jobs (default: tankcal in the documents of the user)",
    )
    app.add_argument(
        "--address",
        metavar="ADDRESS",
        default="127.0.0.1",
        help="address of this machine to listen on (default: 127.0.0.1, not accessible from other "
        "machines)",
    )
    app.add_argument("--port", metavar="N", type=_port, help="port (default: any free port)")
    app.add_argument(
        "--certificate",
        metavar="FILE",
        help="file with certificate and key (PEM) for an encrypted connection",
    )
    app.add_argument(
        "--behind-tls",
        metavar="HOST",
        help="name by which browsers reach a server in front that encrypts the connection",
    )
    app.add_argument(
        "--base-url", metavar="PATH", default="", help="prefix of all addresses, such as /tankcal"
    )
    app.add_argument(
        "--users",
        metavar="FILE",
        help="users of an app that other machines can reach (default: users.toml in the state "
        "folder)",
    )
    app.add_argument(
        "--add-user",
        metavar="NAME",
        help="add a user, or change roles and password, and end; the password is asked for, or "
        "read from standard input",
    )
    app.add_argument(
        "--role", choices=ROLES, action="append", help="with --add-user, a role; may be repeated"
    )
    app.add_argument("--no-browser", action="store_true", help="do not open a browser")
    app.add_argument(
        "--shortcut",
        metavar="DIR",
        nargs="?",
        const="",
        help="write a shortcut that opens the app into DIR (default: desktop and menu of the "
        "user), and do not open it",
    )
    app.set_defaults(command=run_app)


def _port(text):
    if not (text.isascii() and text.isdigit() and 0 < int(text[:9]) <= MOST_PORT):
        raise argparse.ArgumentTypeError(argparse._("invalid int value: %r") % text)
    return int(text)


def run_app(options):
    """Serve the app until Ctrl-C, or open a window of the app that is already running."""
    if options.shortcut is not None:
        from tankcal.products.app.shortcuts import write_shortcuts

        for path in write_shortcuts(options.shortcut or None):
            say(message("shortcut_written", "shortcut: {path}", path=path))
        return
    from tankcal.products.app import serving

    users = Path(options.users or serving.find_state_folder() / "users.toml")
    if options.add_user is not None:
        _add_user(users, options)
        return
    is_local = options.address in ("127.0.0.1", "::1", "localhost")
    if not is_local and not options.certificate and not options.behind_tls:
        expected = message(
            "app_needs_tls",
            "{address} is accessible from other machines; expected --certificate FILE, or "
            "--behind-tls HOST with a server in front that encrypts the connection",
            address=options.address,
        )
        raise InputError(Problem("--address", expected))
    prepare_for_small_work()
    # Behind a server that encrypts, other machines reach a local address, too.
    people = None if is_local and not options.behind_tls else serving.People(users)
    site = serving.Site(options.workspace or serving.default_workspace(), people=people)
    path = "/"
    if options.language is not None:
        speak(options.language)
    if options.job is not None:
        path = f"/job/{site.add(Path(options.job))}/"
    is_second = people is None and options.port is None
    running = serving.running_address() if is_second else None
    if running is not None and not options.base_url:
        address = running.replace("/?", f"{path}?")
        say(message("app_runs", "the app is already running: {address}", address=address))
        if not options.no_browser:
            serving.open_browser(address)
        return
    if is_second:
        bound = serving.last_socket(options.address, site.state)
    else:
        bound = serving.free_socket(options.address, options.port)
    port, token = bound.getsockname()[1], serving.new_token()
    names = {options.address, socket.gethostname().lower(), socket.getfqdn().lower()}
    hosts = [*serving.LOCAL_NAMES] if is_local else sorted(names)
    if options.behind_tls:
        hosts.append(options.behind_tls)
    is_secure = bool(options.certificate or options.behind_tls)
    base = "/" + options.base_url.strip("/") if options.base_url.strip("/") else ""
    application = serving.guard_application(site, port, token, hosts, base, is_secure)
    host = f"[{options.address}]" if ":" in options.address else options.address
    scheme = "https" if is_secure else "http"
    outer = options.behind_tls or f"{host}:{port}"
    query = f"?token={token}" + (f"&language={options.language}" if options.language else "")
    query = query if people is None else ""
    address = f"{scheme}://{outer}{base}{path}{query}"
    say(
        message(
            "app_address", "open {address} in a browser; Ctrl-C stops the server", address=address
        )
    )
    sys.stdout.flush()  # a program that reads the address waits for it
    # A second start opens a window of the app of this machine only.
    restart = f"{scheme}://{outer}{base}/?token={token}"
    state_file = serving.write_state(site.state, restart) if people is None else None
    if not options.no_browser:
        serving.open_browser_meanwhile(address)
    try:
        serving.serve(bound, application, state_file, options.certificate)
    finally:
        site.close()


def _add_user(users, options):
    """Add a user with a password that is typed twice, or read from a pipe."""
    from tankcal.products.app.people import add_user

    if sys.stdin.isatty():
        words = load_words(options.language or language_of_run())["app"]
        password = getpass.getpass(f"{words['password']}: ")
        if getpass.getpass(f"{words['password_again']}: ") != password:
            text = message("user_passwords_differ", "the two passwords differ")
            raise InputError(Problem("--add-user", text))
    else:
        password = sys.stdin.readline().rstrip("\r\n")
    add_user(users, options.add_user, options.role or (), password)
    say(message("user_added", "{name} may log in: {file}", name=options.add_user, file=str(users)))
