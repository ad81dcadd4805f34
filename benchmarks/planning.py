"""Planning: the time of a large plan, and of a greedy study of what helps most.

    python benchmarks/planning.py [ROUNDS]        (default: 20 rounds of 20 candidates)

The goals: a plan of 60 photographs and 3000 targets answered in under 3 s, the greedy study of 20
candidates in under 60 s. One BLAS thread. No open program answers these questions, so there is no
peer beside them.
"""

import os
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from measured import Row, tell

from tankcal.planning import load_plan, predict
from tankcal.planning.improvements import changes_of, greedy
from tankcal.record.plan import plain_of

PLAN = Path(__file__).resolve().parents[1] / "examples" / "plan-silva"
LARGER = {
    "generatrices = 24": "generatrices = 200",
    "levels = 1 ": "levels = 3 ",
    "weld_azimuths_deg = [0.0, 120.0, 240.0]\n": "",
    "stations = 11": "stations = 30",
    "heights_m = [1.4]": "heights_m = [1.4, 5.0]",
}
CANDIDATES = 20


def main(rounds):
    """A row for each measurement."""
    with tempfile.TemporaryDirectory() as folder:
        for path in PLAN.iterdir():
            (Path(folder) / path.name).write_bytes(path.read_bytes())
        enlarge(Path(folder) / "plan.toml")
        for what in ("in a new process", "again"):
            timed(f"plan, {what}", "60 photographs, 3000 targets", lambda: answered(folder))
    small = load_plan(PLAN)
    unlimited = replace(small, limits=replace(small.limits, relative_u=None))
    size = f"{rounds} rounds of {CANDIDATES} candidates"
    path = timed("plan, greedy", size, lambda: greedy(unlimited, steps=rounds, changes=candidates))
    print(f"  {path.evaluations} plans tried, U/V {path.start_u:.6f} to {path.relative_u:.6f}")


def enlarge(path):
    text = path.read_text(encoding="utf-8")
    for old, new in LARGER.items():
        if old not in text:
            raise SystemExit(f"{path.name} has no {old!r} any more")
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")


def answered(folder):
    """From the files to the answer as it is written."""
    plan = load_plan(folder)
    if (len(plan.photos), len(plan.targets.names)) != (60, 3000):
        raise SystemExit("the large plan is not what this benchmark is about any more")
    return plain_of(predict(plan))


def candidates(plan):
    """The first changes that add or repeat something."""
    return changes_of(plan, ("add", "repeat"))[:CANDIDATES]


def timed(name, size, work):
    """What `work` returns; its seconds are a row."""
    start = time.process_time()
    found = work()
    tell(Row(name, size, (time.process_time() - start,)))
    return found


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
