"""Makes the environment of the benchmarks: the one of tankcal with the peers on top of it.

    python benchmarks/peers.py .venv/peers

The peers are the extra `peers` of pyproject.toml. Each is installed by itself; what cannot be is
kept with the installer's last words in errors.json there, and the page of the benchmarks names it.
For programs that are no package of Python, the package manager is asked and installs nothing.
Nothing is installed beside tankcal itself: its tests run without any of this.
"""

import json
import re
import subprocess
import sys
import sysconfig
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LONGEST_S = 300  # for a program or its installation
PROGRAMS = {
    "GNU Gama": ["apt-get", "--simulate", "install", "gama"],
    "JAG3D": ["mvn", "-q", "-B", "dependency:get", "-Dartifact=org.applied-geodesy:jag3d:LATEST"],
}


def main(folder):
    """Make the environment, and install each peer."""
    venv.create(folder, with_pip=True)
    python = Path(folder) / "bin" / "python"
    ask = [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
    inside = subprocess.run(ask, check=True, capture_output=True, text=True).stdout.strip()
    Path(inside, "below.pth").write_text(
        f"import site; site.addsitedir({sysconfig.get_path('purelib')!r})\n"
    )
    errors = {}
    for peer in wanted():
        command = [python, "-m", "pip", "install", "--quiet", peer]
        name = re.match(r"[\w.-]+", peer).group()
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S)
            wrong = told(done.stderr) if done.returncode else ""
        except subprocess.TimeoutExpired:
            wrong = f"not within {LONGEST_S} s"
        if wrong:
            errors[name] = wrong
            print(f"{name} could not be installed: {errors[name]}")
    for name, command in PROGRAMS.items():
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S)
            wrong = missed(done.stdout + done.stderr) if done.returncode else ""
        except OSError as error:
            wrong = f"{command[0]}: {error.strerror}"
        except subprocess.TimeoutExpired:
            wrong = f"not within {LONGEST_S} s"
        errors[name] = wrong or "a package exists, not measured yet"
        print(f"{name}: {errors[name]}")
    (Path(folder) / "errors.json").write_text(json.dumps(errors, indent=1), encoding="utf-8")


def wanted():
    """The requirements of the extra."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return settings["project"]["optional-dependencies"]["peers"]


def told(text):
    """The last error of the installer, one line, without the addresses that it tried."""
    lines = [line for line in text.splitlines() if line.startswith("ERROR")] or [text.strip()]
    return re.sub(r"\w+://\S+", "...", lines[-1].removeprefix("ERROR: "))[:200]


def missed(text):
    """What apt-get or Maven did not find, in its words.

    >>> missed("Reading...\\nE: Unable to locate package gama")
    'Unable to locate package gama'
    """
    words = re.search(r"(Unable to locate|Could not find) \w+ [\w.:/-]+", text)
    return words[0] if words else text.strip()[-200:]


if __name__ == "__main__":
    main(sys.argv[1])
