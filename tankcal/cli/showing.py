"""Progress, warnings and lists of files, as the terminal shows them."""

import os
import sys


def prepare_for_small_work():
    """A second BLAS thread costs time with small matrices, a compiler with small surveys."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("TANKCAL_COMPILED", "patient")


def warn(warnings):
    """Warnings on standard error."""
    for warning in warnings:
        print(f"tankcal: warning: {warning}", file=sys.stderr)


def listed(out, paths):
    """Print what was written."""
    print(f"results in {out}:")
    for path in paths:
        print(f"  {path}")


def counted(count, thing):
    """ "no points", "1 point", "2 points"."""
    return f"{count or 'no'} {thing}{'' if count == 1 else 's'}"


class Progress:
    """One line on standard error a step; a long step counts on in its own line on a terminal."""

    def __init__(self, quiet):
        self.quiet = quiet
        self.live = sys.stderr.isatty()
        self.now = None

    def step(self, text):
        self.part(text, 0, 0)

    def part(self, text, done, total):
        if self.quiet:
            return
        if text != self.now:
            self.end()
            print(f"tankcal: {text}", end="" if self.live else "\n", file=sys.stderr, flush=True)
        if self.live and total:
            print(f"\rtankcal: {text} {done}/{total}", end="", file=sys.stderr, flush=True)
        self.now = text

    def end(self):
        if self.live and self.now and not self.quiet:
            print(file=sys.stderr)
        self.now = None
