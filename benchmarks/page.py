"""Fills the tables of docs/studies/benchmarks.md from the results of a run.

    python benchmarks/page.py build/benchmarks.json docs/studies/benchmarks.md

What stands between the marks is replaced, the prose around it is kept.
"""

import json
import sys
from pathlib import Path

from guard import RELEASED, fallen
from measured import read, shown, sloped, spread, times

BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"


def filled(page, results, released):
    """The page with the tables of these results, compared with the ratios of the last release."""
    before, _, rest = page.partition(BEGIN)
    _, mark, after = rest.partition(END)
    if not mark:
        raise ValueError(f"the page lacks {BEGIN} ... {END}")
    return f"{before}{BEGIN}\n\n{tables(results, released)}\n{END}{after}"


def tables(results, released):
    """All that a run found, as Markdown."""
    found = read(results)
    beside = [row for row in found["rows"] if row.peer]
    alone = [row for row in found["rows"] if not row.peer]
    parts = [
        "### The machine",
        table(("what", "which"), machine_rows(results)),
        "### Beside other programs",
        table(
            ("task", "size", "tankcal", "other program", "its time", "times ours", "right digits"),
            [beside_row(row) for row in beside],
        ),
        "### tankcal alone",
        table(("task", "size", "time", "memory", "remark"), [alone_row(row) for row in alone]),
    ]
    if found["growth"]:
        rows = [growth_row(one) for one in found["growth"]]
        head = ("what", "sizes", "times", "memory", "slopes", "remark")
        parts += ["### Growth", table(head, rows)]
    if found["skipped"]:
        rows = [(one.name, one.peer or "all of it", one.reason) for one in found["skipped"]]
        parts += ["### Left out", table(("task", "program", "why"), rows)]
    fell = fallen(results, released)
    parts += [
        "### Against the last release",
        f"Ratios are compared with those of {released['release']} ({released['date']}, "
        f"{released['machine']['processor']}).",
        "\n".join(f"- {line}" for line in fell) or "None fell by more than a fifth.",
    ]
    return "\n\n".join(parts) + "\n"


def table(head, rows):
    """A table of Markdown."""
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "/") for cell in one) + " |" for one in lines
    )


def machine_rows(results):
    """(what, which) of the machine, the versions, the day."""
    machine, busy = results["machine"], results["others_cores"]
    yield "day", results["date"]
    yield "tankcal", results["version"]
    yield "processor", f"{machine['processor']}, {machine['cores']} cores"
    yield "kernel", machine["kernel"]
    yield from machine["versions"].items()
    yield "rounds", f"{results['rounds']}, more where a task takes milliseconds"
    if busy is not None:
        quiet = "the machine was quiet" if busy < 0.1 else "read ratios, not times"
        yield "other programs took meanwhile", f"{busy:.1f} cores on the average: {quiet}"


def beside_row(row):
    """A row of the table of peers."""
    digits = ", ".join(
        "-" if one is None else f"{one:.1f}" + ("" if met else " (not met)")
        for one, met in zip(row.digits, row.met, strict=True)
    )
    peer = f"{row.peer} {row.version}" + (f"; {row.note}" if row.note else "")
    digits = f"{digits} of {row.answer}" if row.answer else ""
    return (
        row.name,
        row.size,
        spread(row.seconds),
        peer,
        spread(row.peer_seconds),
        times(row),
        digits,
    )


def alone_row(row):
    """A row of the table without peers."""
    memory = f"{row.memory_mb:.0f} MB" if row.memory_mb else ""
    right = "" if row.digits[0] is None else f"{row.digits[0]:.1f} digits of {row.answer}"
    remark = "; ".join(one for one in (row.note, right) if one)
    return row.name, row.size, spread(row.seconds), memory, remark


def growth_row(one):
    """A row of the table of growth."""
    sizes = ", ".join(f"{size:g}" for size in one.sizes) + f" {one.unit}"
    memory = ", ".join(f"{size:.0f}" for size in one.memory_mb) + " MB" * bool(one.memory_mb)
    return one.name, sizes, ", ".join(map(shown, one.seconds)), memory, sloped(one), one.note


def main(results, page):
    """Fill the page from the results."""
    page, results = Path(page), json.loads(Path(results).read_text(encoding="utf-8"))
    released = json.loads(RELEASED.read_text(encoding="utf-8"))
    page.write_text(filled(page.read_text(encoding="utf-8"), results, released), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
