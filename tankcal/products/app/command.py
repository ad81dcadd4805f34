"""`tankcal app`: from a new job to its certificate in a browser."""

import argparse
import base64
import getpass
import os
import shlex
import shutil
import socket
import subprocess
import sys
from pathlib import Path

from tankcal.errors import InputError, Problem, TankcalError, reason_of
from tankcal.messages import message
from tankcal.products.app.access import ROLES
from tankcal.terminal import language_of_run, say, speak
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
    from tankcal.products.app.access import add_user

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


# ---- shortcuts that start the app by a double click, for the desktop of each system


NAME = "tankcal"
COMMENTS = {
    "": "Tank calibration: from the survey to the certificate",
    "pt_BR": "Arqueação de tanques: do levantamento ao certificado",
    "es": "Calibración de tanques: del levantamiento al certificado",
}
_WINDOWS = """\
$shell = New-Object -ComObject WScript.Shell
foreach ($folder in {folders}) {{
  $path = Join-Path $folder 'tankcal.lnk'
  $link = $shell.CreateShortcut($path)
  $link.TargetPath = {program}
  $link.Arguments = {arguments}
  $link.WorkingDirectory = [Environment]::GetFolderPath('MyDocuments')
  $link.Description = {comment}
  $link.Save()
  [Console]::Out.WriteLine($path)
}}
"""


def write_shortcuts(folder=None, system=sys.platform):
    """Write shortcuts that open the app.

    Parameters
    ----------
    folder : path or None
        Where to write it; None: desktop and menu of the user.
    system : str
        As `sys.platform`.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        If a folder cannot be written.
    """
    if folder is not None:
        folder = Path(folder).absolute()
    program = _program()
    if system == "win32":
        return _write_links(folder, program)
    is_mac = system == "darwin"
    name = f"{NAME}.command" if is_mac else f"{NAME}.desktop"
    content = f"#!/bin/sh\nexec {shlex.join(program)}\n" if is_mac else _entry(program)
    places = [folder] if folder else _find_folders(is_mac)
    written = []
    for place in places:
        path = place / name
        try:
            place.mkdir(parents=True, exist_ok=True)
            path.write_text(content, encoding="utf-8")
            path.chmod(0o755)
        except OSError as error:
            raise InputError(Problem(str(path), reason_of(error))) from error
        written.append(path)
    return written


def _program():
    """Return the words of the command that opens the app, independent of the search path."""
    if getattr(sys, "frozen", False):
        return [sys.executable, "app"]
    return [os.path.abspath(sys.executable), "-m", "tankcal", "app"]


def _find_folders(is_mac):
    """Return the desktop of the user, and on Linux the folder of the menu."""
    home = Path.home()
    if is_mac:
        return [home / "Desktop"]
    data = Path(os.environ.get("XDG_DATA_HOME") or home / ".local" / "share")
    folders = [data / "applications"]
    if shutil.which("xdg-user-dir"):
        done = subprocess.run(["xdg-user-dir", "DESKTOP"], capture_output=True, text=True)
        desktop = Path(done.stdout.strip())
    else:
        desktop = home / "Desktop"
    if desktop.is_dir() and desktop != home:
        folders.append(desktop)
    return folders


def _entry(program):
    """Return a desktop entry; its terminal shows the address, and closing it ends the app."""
    comments = (
        f"Comment[{code}]={text}" if code else f"Comment={text}" for code, text in COMMENTS.items()
    )
    words = " ".join(map(_quote_for_entry, program))
    lines = (
        "[Desktop Entry]", "Type=Application", f"Name={NAME}", *comments, f"Exec={words}",
        "Terminal=true", "Categories=Science;Engineering;",
    )  # fmt: skip
    return "\n".join(lines) + "\n"


def _quote_for_entry(word):
    """Quote a word of Exec: first as an argument, then as a string of the file."""
    for character in '\\"`$':
        word = word.replace(character, f"\\{character}")
    return '"' + word.replace("\\", "\\\\").replace("%", "%%") + '"'


def _write_links(folder, program):
    """Let the shell of Windows write the shortcuts, because their format is binary."""
    text = _WINDOWS.format(
        folders="@("
        + (
            _quote_for_windows(str(folder))
            if folder
            else "[Environment]::GetFolderPath('Desktop'), [Environment]::GetFolderPath('Programs')"
        )
        + ")",
        program=_quote_for_windows(program[0]),
        arguments=_quote_for_windows(subprocess.list2cmdline(program[1:])),
        comment=_quote_for_windows(COMMENTS[""]),
    )
    encoded = base64.b64encode(text.encode("utf-16-le")).decode("ascii")
    command = ["powershell", "-NoProfile", "-NonInteractive", "-EncodedCommand", encoded]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError) as error:
        raise TankcalError(
            message(
                "shortcut_refused",
                "PowerShell wrote no shortcut; create a shortcut to {program} by hand",
                program=subprocess.list2cmdline(program),
            )
        ) from error
    return [Path(line) for line in done.stdout.splitlines() if line]


def _quote_for_windows(text):
    """Quote a text for PowerShell, which also accepts typographic quotation marks as quotes."""
    for mark in "'\u2018\u2019\u201a\u201b":
        text = text.replace(mark, mark * 2)
    return f"'{text}'"
