"""Zips that install tankcal without a network: wheels of a system, and a script to double-click.

    python installers/offline.py WHEEL [SYSTEM ...]       (SYSTEM: windows, macos, linux)

writes dist/tankcal-offline-SYSTEM.zip. pip resolves the wheels here, but it evaluates the
conditions of requirements for this system. Therefore the metadata of all wheels are read again with
the conditions of the other system, and missing wheels are added until every requirement is met.
"""

import shutil
import subprocess
import sys
import zipfile
from email.parser import Parser
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name, parse_wheel_filename

ROOT = Path(__file__).resolve().parents[1]
HERE = ROOT / "installers"
PYTHON = "3.12"  # of Windows and macOS, whose wheels are for one version of Python
THIS_PYTHON = "{}.{}".format(*sys.version_info)
SYSTEMS = {
    # system: (version of Python, tags of its wheels, conditions of requirements, its script)
    "windows": (PYTHON, ("win_amd64",), {
        "sys_platform": "win32", "platform_system": "Windows", "os_name": "nt",
        "platform_machine": "AMD64",
    }, "install.bat"),
    "macos": (PYTHON, ("macosx_11_0_arm64", "macosx_12_0_arm64"), {
        "sys_platform": "darwin", "platform_system": "Darwin", "os_name": "posix",
        "platform_machine": "arm64",
    }, "install.command"),
    "linux": (THIS_PYTHON, tuple(f"manylinux_2_{n}_x86_64" for n in (17, 24, 27, 28)), {
        "sys_platform": "linux", "platform_system": "Linux", "os_name": "posix",
        "platform_machine": "x86_64",
    }, "install.command"),
}  # fmt: skip
DATE = (1980, 1, 1, 0, 0, 0)  # of all files, so that the same wheels give the same bytes


def main(arguments):
    """Write the zip of each system."""
    wheel, *systems = arguments
    for system in systems or SYSTEMS:
        folder = ROOT / "build" / "offline" / system
        wheels = gather(Path(wheel), system, folder / "wheels")
        path = pack(system, folder)
        size = path.stat().st_size / 1e6
        print(f"{path.relative_to(ROOT)}: {len(wheels)} wheels, {size:.0f} MB")


def gather(wheel, system, folder):
    """Fetch the wheels of a system until the requirements of all of them are met; their paths."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    fetch = ("download", "--dest", folder, "--constraint", ROOT / "constraints.txt")
    pip(system, *fetch, wheel)
    while missing := find_missing(system, folder):
        pip(system, *fetch, *missing)
    pip(system, "install", "--dry-run", "--ignore-installed", "--no-index", "--find-links", folder,
        "--target", folder / "none", "tankcal")  # fmt: skip
    return sorted(folder.glob("*.whl"))


def pip(system, command, *arguments):
    """Run pip for the wheels of another system."""
    python, tags, *_ = SYSTEMS[system]
    words = [sys.executable, "-m", "pip", command, "--quiet", "--only-binary=:all:"]
    words += ["--implementation", "cp", "--python-version", python]
    words += [word for tag in tags for word in ("--platform", tag)]
    subprocess.run([*words, *map(str, arguments)], check=True)


def find_missing(system, folder):
    """Requirements that no wheel of a folder meets, under the conditions of a system."""
    python, _, conditions, _ = SYSTEMS[system]
    environment = {
        **conditions, "python_version": python, "python_full_version": f"{python}.0",
        "implementation_name": "cpython", "platform_python_implementation": "CPython", "extra": "",
    }  # fmt: skip
    wheels = {path: parse_wheel_filename(path.name) for path in folder.glob("*.whl")}
    versions = {name: version for name, version, *_ in wheels.values()}
    missing = set()
    for path in wheels:
        for text in read_requirements(path):
            needed = Requirement(text)
            if needed.marker and not needed.marker.evaluate(environment):
                continue
            version = versions.get(canonicalize_name(needed.name))
            if version is None or not needed.specifier.contains(version, prereleases=True):
                missing.add(f"{needed.name}{needed.specifier}")
    return sorted(missing)


def read_requirements(path):
    """Requirements in the metadata of a wheel."""
    with zipfile.ZipFile(path) as archive:
        (name,) = (
            name for name in archive.namelist()
            if name.endswith(".dist-info/METADATA") and name.count("/") == 1
        )  # fmt: skip
        metadata = Parser().parsestr(archive.read(name).decode("utf-8"))
    return metadata.get_all("Requires-Dist") or []


def pack(system, folder):
    """Write the zip of a system."""
    python, _, _, script = SYSTEMS[system]
    path = ROOT / "dist" / f"tankcal-offline-{system}.zip"
    path.parent.mkdir(exist_ok=True)
    with zipfile.ZipFile(path, "w") as archive:
        for name in (script, "README.txt"):
            text = (HERE / name).read_text(encoding="utf-8").replace("@PYTHON@", python)
            text = text.replace("@SCRIPT@", script)
            add(archive, name, text.encode(), is_program=name == script, is_dos=system == "windows")
        for wheel in sorted((folder / "wheels").glob("*.whl")):
            add(archive, f"wheels/{wheel.name}", wheel.read_bytes())
    return path


def add(archive, name, content, is_program=False, is_dos=False):
    """Add a file under the folder tankcal-offline."""
    entry = zipfile.ZipInfo(f"tankcal-offline/{name}", DATE)
    entry.create_system = 3  # Unix, so that the script may be run
    entry.external_attr = (0o100755 if is_program else 0o100644) << 16
    archive.writestr(entry, content.replace(b"\n", b"\r\n") if is_dos else content)


if __name__ == "__main__":
    main(sys.argv[1:])
