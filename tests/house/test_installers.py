"""Zips of wheels for other systems: requirements that pip does not see from here."""

import sys
import zipfile
from importlib import import_module
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "installers"))
offline = import_module("offline")


def write_wheel(folder, name, version, *requirements):
    with zipfile.ZipFile(folder / f"{name}-{version}-py3-none-any.whl", "w") as archive:
        lines = [f"Name: {name}", f"Version: {version}"]
        lines += [f"Requires-Dist: {text}" for text in requirements]
        archive.writestr(f"{name}-{version}.dist-info/METADATA", "\n".join(lines) + "\n\nText")


@pytest.mark.parametrize(
    ("system", "missing"),
    [("windows", ["colours>=1"]), ("macos", ["frames"]), ("linux", [])],
)
def test_requirements_of_another_system_are_found(tmp_path, system, missing):
    write_wheel(
        tmp_path, "tank", "1.0", "wall_fit>=2", "colours>=1; sys_platform == 'win32'",
        "frames; platform_system == 'Darwin'", "old; python_version < '3.11'",
        "notebook; extra == 'lab'",
    )  # fmt: skip
    write_wheel(tmp_path, "wall_fit", "2.1.dev3")
    write_wheel(tmp_path, "colours", "0.9")
    assert offline.find_missing(system, tmp_path) == missing


def test_scripts_of_windows_have_its_line_ends_and_may_be_run_elsewhere(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        offline.add(archive, "install.bat", b"a\nb\n", is_program=True, is_dos=True)
        offline.add(archive, "install.command", b"a\nb\n", is_program=True)
    with zipfile.ZipFile(tmp_path / "a.zip") as archive:
        assert archive.read("tankcal-offline/install.bat") == b"a\r\nb\r\n"
        assert archive.read("tankcal-offline/install.command") == b"a\nb\n"
        assert archive.getinfo("tankcal-offline/install.command").external_attr >> 16 == 0o100755
