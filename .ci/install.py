"""Install this folder and its packages into the running environment, with progress on a line each.

python .ci/install.py ARGUMENT ...  (arguments of `pip install`)
"""

import re
import subprocess
import sys
import sysconfig
import threading
from contextlib import suppress
from pathlib import Path

EVERY_S = 2  # between two lines about what is being unpacked
FETCHED = re.compile(r"\s*(?:Downloading|Using cached|Processing) \S*?([\w.]+)-\S+(?: \((.*?)\))?$")


def main(arguments):
    """Run pip, print packages as they arrive and megabytes as they are unpacked; its status."""
    command = [sys.executable, "-m", "pip", "install", "--no-compile", "--progress-bar", "off"]
    pip = subprocess.Popen([*command, *arguments], stdout=subprocess.PIPE, text=True)
    is_over, lines, count = threading.Event(), [], 0
    unpacking = threading.Thread(target=watch, args=(is_over,))
    for line in pip.stdout:
        lines.append(line)
        if fetched := FETCHED.match(line):
            count += 1
            print(
                f"  package {count}: {fetched[1]}, {fetched[2] or 'from this machine'}", flush=True
            )
        if line.startswith("Installing collected packages"):
            print(f"  unpacking {line.count(',') + 1} packages", flush=True)
            unpacking.start()
    status = pip.wait()
    is_over.set()
    if unpacking.is_alive():
        unpacking.join()
    if status:
        print("".join(lines[-20:]), end="")
    return status


def watch(is_over):
    """Print the size of the installed packages until they are complete."""
    folder = Path(sysconfig.get_path("platlib"))
    while not is_over.wait(EVERY_S):
        size = 0
        for path in folder.rglob("*"):
            with suppress(OSError):  # pip moves files meanwhile
                size += path.stat().st_size
        print(f"  {size / 1e6:.0f} MB unpacked", flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
