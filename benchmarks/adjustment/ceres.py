"""C++ Ceres as a peer: a process that solves on command (ceres_peer.cpp, built by `make` here)."""

import json
import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent
SOLVER = "DENSE_SCHUR"  # Ceres' fastest on these problems


def built():
    """Why the peer cannot be built, or an empty text; it is built where it is not yet."""
    done = subprocess.run(["make", "-s", "-C", HERE], capture_output=True, text=True)
    wrong = [line for line in done.stderr.splitlines() if "rror" in line]
    return wrong[0].split("error: ")[-1] if wrong else done.stderr.strip() * bool(done.returncode)


class Ceres:
    """A running ceres_peer: one command, one answer. radius: of the trust region, 0 its default."""

    def __init__(self, kind, path, radius=0.0):
        self.process = subprocess.Popen(
            [HERE / "build" / "ceres_peer", kind, path],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        self.name = "Ceres in C++, wide trust region" if radius else "Ceres in C++"
        self.version, self.radius, self.note = self.ask("version")["version"], radius, ""
        self.covers = not radius  # the covariances are the same

    def ask(self, line):
        """The answer to a command, a dict."""
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def solve(self):
        """(seconds, cost) from the start values."""
        found = self.ask(f"solve {SOLVER} {self.radius:g} 0")
        return found["seconds"], found["cost"]

    def covariance(self, kind):
        """(seconds, trace of all points) at the last solution; kind: full or marginal."""
        found = self.ask(f"covariance {kind}")
        return found["seconds"], found["trace"]

    def close(self):
        """End the process."""
        self.process.communicate()
