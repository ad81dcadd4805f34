"""Shortcuts that start the app by a double click, for the desktop of each system."""

import base64
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

from tankcal.errors import InputError, Problem, TankcalError, reason_of
from tankcal.messages import message

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
