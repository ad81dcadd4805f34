"""Tells which ratios fell by more than a fifth against those of the last release; fails nothing.

    python benchmarks/guard.py build/benchmarks.json            what fell, one line each
    python benchmarks/guard.py build/benchmarks.json --keep 0.2.0    those are the ratios of 0.2.0

The ratios of the last release stand in released.json. A ratio is how many times tankcal's seconds
of processor a peer takes, both measured in turns, so it means something on another machine, too;
that it was another one, or with other versions, is told.
"""

import argparse
import json
from pathlib import Path

from measured import read

RELEASED = Path(__file__).resolve().parent / "released.json"
FALL = 0.2


def ratios_of(results):
    """{"task, against peer": ratio} of the results of a run."""
    return {
        f"{row.name}, against {row.peer}": float(f"{row.ratio[0]:.4g}")
        for row in read(results)["rows"]
        if row.ratio
    }


def fallen(results, released):
    """Lines, one for each ratio that fell by more than a fifth."""
    here, there = results["machine"], released["machine"]
    place = ""
    if here["processor"] != there["processor"]:
        place = f" on another machine ({there['processor']})"
    if changed := sorted({*there["versions"].items()} - {*here["versions"].items()}):
        place += f" with {', '.join(map(' '.join, changed))}"
    now = ratios_of(results)
    return [
        f"fell by {100 * (1 - now[name] / then):.0f} %: {name}: {now[name]:.3g} times, "
        f"{then:.3g} at {released['release']}{place}"
        for name, then in released["ratios"].items()
        if name in now and now[name] < (1 - FALL) * then
    ]


def kept(results, release):
    """What released.json holds of a run."""
    named = {key: results[key] for key in ("date", "version", "machine")}
    return {"release": release, **named, "ratios": ratios_of(results)}


def main():
    """Print what fell, or keep what was measured as that of a release."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("--keep", metavar="RELEASE")
    asked = parser.parse_args()
    results = json.loads(asked.results.read_text(encoding="utf-8"))
    if asked.keep:
        text = json.dumps(kept(results, asked.keep), indent=1, ensure_ascii=False)
        RELEASED.write_text(text + "\n", encoding="utf-8")
        return
    for line in fallen(results, json.loads(RELEASED.read_text(encoding="utf-8"))):
        print(line)


if __name__ == "__main__":
    main()
