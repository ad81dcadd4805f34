"""Shortcuts that open the app by a double click."""

import base64
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time

import pytest

from tankcal.cli import main
from tankcal.products.app import command as shortcuts


@pytest.mark.parametrize("system", ["linux", "darwin"])
def test_a_shortcut_starts_the_app_whatever_its_folder_is_called(tmp_path, monkeypatch, system):
    """The words of the file are read back by the rules of its format, here and by a shell."""
    odd = tmp_path / """a $b `c` "d" \\e 100% f"""
    odd.mkdir()
    program = odd / "python"
    program.write_text('#!/bin/sh\nprintf "%s|" "$0" "$@"\n')
    program.chmod(0o755)
    monkeypatch.setattr("sys.executable", str(program))
    (path,) = shortcuts.write_shortcuts(tmp_path, system)
    assert path.stat().st_mode & 0o111
    if system == "darwin":
        command = [str(path)]
    else:
        (line,) = (text for text in path.read_text().splitlines() if text.startswith("Exec="))
        value = re.sub(r"\\(.)", r"\1", line.removeprefix("Exec=")).replace("%%", "%")
        command = ["sh", "-c", value]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert told == f"{program}|-m|tankcal|app|"


def test_shortcuts_are_written_to_desktop_and_menu(tmp_path, monkeypatch, capsys):
    (tmp_path / "Desktop").mkdir()
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setattr(shortcuts.shutil, "which", lambda name: None)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    assert main(["app", "--shortcut"]) == 0
    lines = capsys.readouterr().out.splitlines()
    written = [tmp_path / "data/applications/tankcal.desktop", tmp_path / "Desktop/tankcal.desktop"]
    assert lines == [f"shortcut: {path}" for path in written]
    assert all(path.is_file() for path in written)
    (tmp_path / "file").touch()
    assert main(["app", "--shortcut", str(tmp_path / "file/folder")]) == 2


def test_the_shortcut_of_windows_is_written_by_its_shell(tmp_path, monkeypatch):
    """Without Windows, only the text that PowerShell gets is checked."""
    called = []

    def run(command, **_):
        called.append(base64.b64decode(command[-1]).decode("utf-16-le"))
        return subprocess.CompletedProcess(command, 0, "C:\\tankcal.lnk\n")

    monkeypatch.setattr(shortcuts.subprocess, "run", run)
    monkeypatch.setattr("sys.executable", "/O'Brien/python.exe")
    assert [str(path) for path in shortcuts.write_shortcuts(None, "win32")] == ["C:\\tankcal.lnk"]
    assert "$link.TargetPath = '/O''Brien/python.exe'" in called[0]
    assert "$link.Arguments = '-m tankcal app'" in called[0]
    assert "GetFolderPath('Desktop')" in called[0]


@pytest.mark.skipif(not shutil.which("desktop-file-validate"), reason="no desktop-file-utils here")
def test_the_entry_is_valid_for_its_standard(tmp_path):
    (path,) = shortcuts.write_shortcuts(tmp_path, "linux")
    done = subprocess.run(["desktop-file-validate", str(path)], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "")


@pytest.mark.slow
def test_a_browser_in_the_foreground_gets_the_page(tmp_path):
    """A browser that returns only when it is closed, and asks before the server answers."""
    browser = tmp_path / "browser"
    got = tmp_path / "page"
    code = (
        "import sys, urllib.request as r; o = r.build_opener(r.HTTPCookieProcessor());"
        f"open({str(got)!r}, 'wb').write(o.open(sys.argv[1], timeout=60).read())"
    )
    browser.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -c "{code}" "$1"\n')
    browser.chmod(0o755)
    environment = {**os.environ, "DISPLAY": ":99", "BROWSER": str(browser), "HOME": str(tmp_path),
                   "TANKCAL_STATE": str(tmp_path / "state")}  # fmt: skip
    command = [sys.executable, "-m", "tankcal"]
    with subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL) as app:
        try:
            end = time.monotonic() + 60
            while not (got.is_file() and b"</html>" in got.read_bytes()):
                assert app.poll() is None
                assert time.monotonic() < end
                time.sleep(0.1)
        finally:
            app.send_signal(signal.SIGINT)
            app.wait(30)
