"""What a benchmark says as data, the same for all: rows, peers that were left out, growth.

A benchmark calls `tell` for each; it is printed, and kept as a line of JSON in the file that
$BENCHMARKS names (`run.py` gives one, and gathers them). Seconds are of processor, medians over
rounds; the programs of a row take turns (A B A B ...), so a ratio is the median of those of the
rounds, and its spread their least and largest.
"""

import importlib
import importlib.metadata
import json
import math
import os
import statistics
import sys
import time
from dataclasses import asdict, dataclass
from itertools import zip_longest
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
SHARED = Path(os.environ.get("TANKCAL_DATA", ROOT.parent / "shared"))
ROUNDS = int(os.environ.get("ROUNDS", 5))
MOST_DIGITS = 16.0
# Whoever installs tankcal has it compiled: without this each command would compile it anew, 0.6 s.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


@dataclass(frozen=True)
class Row:
    """Seconds of tankcal for one task, and of a peer beside it where there is one.

    name, size      the task, and how large it is
    seconds         of tankcal, of each round
    peer, version   the other program; empty: tankcal alone
    peer_seconds    of the peer, of each of its rounds
    answer          what was compared with the right answer before the clocks ran; empty: nothing
    digits          that agree with it: of tankcal, of the peer
    least           digits that count as met
    memory_mb       largest memory of tankcal's process
    note            what a reader must know
    """

    name: str
    size: str
    seconds: tuple[float, ...]
    peer: str = ""
    version: str = ""
    peer_seconds: tuple[float, ...] = ()
    answer: str = ""
    digits: tuple[float | None, float | None] = (None, None)
    least: float = 0.0
    memory_mb: float | None = None
    note: str = ""

    @property
    def met(self):
        """(of tankcal, of the peer): whether the right answer was met; None: not compared."""
        return tuple(None if one is None else one >= self.least for one in self.digits)

    @property
    def ratio(self):
        """(median, least, largest) peer to tankcal; None without a peer or with a wrong answer."""
        pairs = list(zip(self.peer_seconds, self.seconds, strict=False))
        if not pairs or False in self.met:
            return None
        ratios = [theirs / ours for theirs, ours in pairs]
        return statistics.median(ratios), min(ratios), max(ratios)


@dataclass(frozen=True)
class Skipped:
    """A peer, or a whole task (no peer), that was left out, and why."""

    name: str
    peer: str
    reason: str


@dataclass(frozen=True)
class Growth:
    """How seconds, and memory where it was measured, grow with size."""

    name: str
    unit: str
    sizes: tuple[float, ...]
    seconds: tuple[float, ...]
    memory_mb: tuple[float, ...] = ()
    note: str = ""

    @property
    def slopes(self):
        """Of log(seconds) over log(size), between each size and the one before."""
        return np.diff(np.log(self.seconds)) / np.diff(np.log(self.sizes))


KINDS = {"rows": Row, "skipped": Skipped, "growth": Growth}


def tell(what):
    """Print a `Row`, `Skipped` or `Growth`, and keep it for `run.py`."""
    print(line_of(what), flush=True)
    if to := os.environ.get("BENCHMARKS"):
        (kind,) = (name for name, made in KINDS.items() if isinstance(what, made))
        with open(to, "a", encoding="utf-8") as file:
            file.write(json.dumps({"kind": kind, **asdict(what)}) + "\n")


def gathered(lines):
    """{kind: list} of what `tell` kept, from its lines."""
    found = {kind: [] for kind in KINDS}
    for line in lines:
        values = json.loads(line)
        found[values.pop("kind")].append(values)
    return found


def read(plain):
    """{kind: list of `Row`, `Skipped`, `Growth`} of a file of results as JSON reads it."""
    return {
        kind: [
            made(**{k: tuple(v) if isinstance(v, list) else v for k, v in one.items()})
            for one in plain.get(kind, ())
        ]
        for kind, made in KINDS.items()
    }


def line_of(what):
    """One line of text about a row, a peer that was left out, or growth."""
    if isinstance(what, Skipped):
        return f"{what.name}: {what.peer or 'all of it'} left out: {what.reason}"
    if isinstance(what, Growth):
        each = ", ".join(
            f"{size:g}: {shown(seconds)}" + (f", {memory:.0f} MB" if memory else "")
            for size, seconds, memory in zip_longest(what.sizes, what.seconds, what.memory_mb)
        )
        return f"{what.name}, {what.unit}: slopes {sloped(what)} ({each})"
    parts = [f"{what.name} ({what.size}): tankcal {spread(what.seconds)}"]
    if what.memory_mb:
        parts.append(f"{what.memory_mb:.0f} MB")
    if what.peer:
        parts.append(f"{what.peer} {what.version} {spread(what.peer_seconds)}, {times(what)}")
    if what.answer:
        parts.append(answered(what))
    return ", ".join(parts) + (f" ({what.note})" if what.note else "")


def sloped(growth):
    """The slopes of a growth."""
    return ", ".join(f"{slope:.2f}" for slope in growth.slopes)


def shown(seconds):
    """Seconds with a unit, three digits.

    >>> shown(0.01234), shown(12.345), shown(213.2)
    ('12.3 ms', '12.3 s', '213 s')
    """
    value, unit = (1e3 * seconds, "ms") if seconds < 1 else (seconds, "s")
    digits = max(0, 2 - math.floor(math.log10(value))) if value > 0 else 2
    return f"{value:.{digits}f} {unit}"


def spread(seconds):
    """Median of the rounds, with the least and the largest where there are several."""
    if not seconds:
        return "not timed"
    middle = shown(statistics.median(seconds))
    return (
        middle if len(seconds) < 2 else f"{middle} ({shown(min(seconds))} to {shown(max(seconds))})"
    )


def times(row):
    """How many times tankcal's seconds the peer takes."""
    if row.ratio is None:
        return "no ratio: a wrong answer" if False in row.met else "no ratio"
    middle, low, high = (f"{one:.0f}" if one >= 100 else f"{one:.3g}" for one in row.ratio)
    return f"{middle} times" + (f" ({low} to {high})" if low != high else "")


def answered(row):
    """To how many digits the right answer was met, by each."""
    told = []
    for name, digits, met in zip(("tankcal", row.peer), row.digits, row.met, strict=True):
        if digits is not None:
            told.append(f"{name} {digits:.1f}" + ("" if met else " (not met)"))
    return f"digits of {row.answer}: " + ", ".join(told)


def digits_of(found, right):
    """Decimal digits to which what was found agrees with the right answer, the worst of an array.

    >>> digits_of(1.001, 1.0), digits_of(2.0, 2.0)
    (3.0, 16.0)
    """
    found, right = np.asarray(found, dtype=float), np.asarray(right, dtype=float)
    difference = np.max(np.abs(found - right) / np.abs(right))
    if not np.isfinite(difference):
        return 0.0
    return round(float(min(MOST_DIGITS, -np.log10(max(difference, 1e-300)))), 1)


def interleaved(tasks, rounds=ROUNDS):
    """Seconds of processor of each task, of each round, all tasks in turn.

    tasks {name: callable}; one that gives a number gives its own seconds, such as another process
    has measured. Returns {name: (rounds,) seconds}.
    """
    seconds = {name: [] for name in tasks}
    for _ in range(rounds):
        for name, task in tasks.items():
            start = time.process_time()
            given = task()
            own = time.process_time() - start
            seconds[name].append(given if isinstance(given, float) else own)
    return {name: tuple(values) for name, values in seconds.items()}


def peer_module(name, task):
    """(module, version) of a peer of Python, or None: then it is told why."""
    try:
        return importlib.import_module(name), importlib.metadata.version(name)
    except (ImportError, OSError) as error:  # not there, or without a library of the system
        tell(Skipped(task, name, installation_error(name) or str(error).split("\n")[0]))
        return None


def installation_error(name):
    """What the package installer said of a peer (`peers.py`), or an empty text."""
    kept = Path(sys.prefix) / "errors.json"
    return json.loads(kept.read_text(encoding="utf-8")).get(name, "") if kept.exists() else ""
