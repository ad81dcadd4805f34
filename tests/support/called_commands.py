"""Commands of `tankcal` called as a user calls them, with small valid inputs for each command.

    make_bases(folder)                      yields (name, Base), one or more for each command
    outcome = call(base, files, place)      the command with these input files, in a new folder
    list_faults(base, outcome)              tracebacks, hangs, falling tables, lost results

The arguments of a base name its input folder {in} and, if the command writes, its output {out}.
Before each call the output of the unspoilt input is put there, as earlier results.
"""

import contextlib
import csv
import io
import json
import math
import re
import shutil
import signal
import time
import traceback
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

from conftest import EXAMPLE
from exported_records import lying, written_record
from inspection_files import plain as plain_inspection
from intercomparison.packages import answers_of, write_answers, written_package
from job_builder import job_parts, write_book, write_folder
from simulated_fieldbooks import base_job, two_stands
from tables_of_others import AREA_M2
from written_fieldbooks import PROFILE, WRITERS
from written_pdfs import write_pdf

from tankcal import cli

EXAMPLES = EXAMPLE.parent
MOST_S = 20  # of processor time for one small input
COARSE = {"table.step_m": 0.5}
_STEPS = (
    (re.compile(rb"(?m)^monte_carlo *=.*\n"), b""),
    (re.compile(rb"(?m)^step_m *=.*$"), b"step_m = 0.5\nmonte_carlo = false"),
    (re.compile(rb"(?m)^fine_step_m *=.*$"), b"fine_step_m = 0.1"),
)


@dataclass(frozen=True)
class Base:
    """A command with a valid input.

    arguments  of the command line, with {in} and {out}
    files      {path below {in}: bytes}
    spoilt     names of the files that are spoilt; (): all of them
    exact      names of the files whose bytes are compared by their hash
    statuses   exit statuses that the help of the command documents
    earlier    {path below {out}: bytes} that the valid input gives
    keeps      whether earlier results stay as they were unless the exit status is 0
    complains  whether problems are on standard error; a finding is a result on standard output
    valid      Outcome of the valid input; None: not called so far
    """

    arguments: tuple
    files: dict
    spoilt: tuple = ()
    exact: tuple = ()
    statuses: tuple = (0, 2)
    earlier: dict = field(default_factory=dict)
    keeps: bool = True
    complains: bool = True
    valid: object = None


@dataclass(frozen=True)
class Outcome:
    """Result of one call in a folder, with the files before and after it as {path: bytes}."""

    place: Path
    status: int | None
    out: str
    err: str
    error: str
    seconds: float
    before: dict
    after: dict


class TooLong(BaseException):
    """A command took more than MOST_S of processor time."""


# ---- calling


def read_tree(folder):
    """{path below a folder: bytes} of its files."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def write_tree(folder, files):
    """Write {path below a folder: bytes}."""
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


def call(base, files, place):
    """Outcome of the command of a base with other input files, in the new folder `place`."""
    shutil.rmtree(place, ignore_errors=True)
    places = {"in": place / "in", "out": place / "out"}
    write_tree(places["in"], files)
    if any("{out}/" in one for one in base.arguments):
        places["out"].mkdir()
    write_tree(places["out"], base.earlier)
    before = read_tree(place)
    arguments = [
        one.replace("{in}", str(places["in"])).replace("{out}", str(places["out"]))
        for one in base.arguments
    ]
    start = time.process_time()
    status, out, err, error = call_main(arguments, place)
    seconds = time.process_time() - start
    return Outcome(place, status, out, err, error, seconds, before, read_tree(place))


def call_main(arguments, folder):
    """(exit status, standard output, standard error, traceback) of a command in a folder."""
    out, err = io.StringIO(), io.StringIO()
    status, error = None, ""
    old = signal.signal(signal.SIGPROF, _stop)
    signal.setitimer(signal.ITIMER_PROF, MOST_S)
    try:
        with (
            contextlib.chdir(folder),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
        ):
            status = cli.main(arguments)
    except SystemExit as stop:
        status = stop.code or 0
    except BaseException as raised:
        if isinstance(raised, KeyboardInterrupt):
            raise
        error = "".join(traceback.format_exception(raised))
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, old)
    return status, out.getvalue(), err.getvalue(), error


def _stop(*_):
    raise TooLong(f"more than {MOST_S} s of processor time")


# ---- judging


def list_faults(base, outcome):
    """Lines about what a user must never meet; none: the outcome is as documented."""
    faults = []
    if outcome.error:
        return [f"uncaught: {outcome.error}"]
    if outcome.seconds > MOST_S:
        faults.append(f"{outcome.seconds:.0f} s of processor time")
    if "Traceback" in outcome.out + outcome.err:
        faults.append("a traceback is printed")
    if outcome.status not in base.statuses:
        faults.append(f"exit status {outcome.status}: the help has {base.statuses}")
    if outcome.status and not (outcome.err.strip() or (not base.complains and outcome.out.strip())):
        faults.append(f"exit status {outcome.status} without a line")
    if any(ord(char) < 32 and char not in "\n\t" for char in _without_progress(outcome)):
        faults.append("a control character is printed")
    if outcome.status and base.keeps:
        faults += _list_changes(outcome)
    else:
        faults += [f"{name}: {one}" for name, data in outcome.after.items()
                   if name not in outcome.before or outcome.before[name] != data
                   for one in _list_table_faults(name, data)]  # fmt: skip
        if "--json" in base.arguments:
            faults += _list_number_faults("standard output", outcome.out)
    left = [name for name in outcome.after if ".tankcal-" in name]
    return faults + [f"left behind: {name}" for name in left]


def _without_progress(outcome):
    return (outcome.out + outcome.err).replace("\r", "").replace("\x1b[K", "")


def _list_changes(outcome):
    names = sorted({*outcome.before, *outcome.after})
    changed = [name for name in names if outcome.before.get(name) != outcome.after.get(name)]
    return [f"{name} changed with exit status {outcome.status}" for name in changed]


def _list_table_faults(name, data):
    """Falling volumes and numbers that are none, of a file that a command wrote."""
    if name.endswith(".json"):
        return _list_number_faults(name, data.decode(json.detect_encoding(data)))
    if Path(name).name == "capacity.csv":
        rows = csv.DictReader(io.StringIO(data.decode("utf-8-sig")))
        return _list_falls([float(row["volume_m3"]) for row in rows])
    return []


def _list_number_faults(name, text):
    """Faults of the numbers of a JSON text."""
    constants = []
    try:
        saved = json.loads(text, parse_constant=constants.append)
    except ValueError as error:
        return [f"no JSON: {error}"]
    table = saved.get("capacity") if isinstance(saved, dict) else None
    faults = [f"{name} has {one}" for one in constants]
    return faults + (_list_falls(table["volume_m3"]) if table else [])


def _list_falls(volumes):
    if not all(map(math.isfinite, volumes)):
        return ["a volume is no number"]
    falls = [(a, b) for a, b in pairwise(volumes) if b < a]
    return [f"volumes fall from {a} to {b} m3" for a, b in falls[:1]]


# ---- valid inputs


MAKERS = ("runs", "results", "quantities", "plans", "tables", "imports", "cameras", "answers")


DEAR = (  # a valid input takes a second of processor time or more; the command has another base
    "run liquid", "run liquid-lying", "run ship", "run tangents", "run total-station",
    "run wall-hits", "run silva-1995-photos", "run cloud", "run rings", "run strict", "report",
    "plan reference-line", "plan wall-hits", "plan tangents", "plan liquid", "plan silva",
    "read-table lying", "camera influence", "answer", "ticket document",
    "gauge certificate", "chart",
)  # fmt: skip


def make_bases(folder, makers=MAKERS, leave=()):
    """Yield (name, Base with the results of its valid input) of some of MAKERS.

    leave  names that are left out
    """
    for maker in makers:
        for name, base in globals()[f"_make_{maker}"](folder / maker).items():
            if name not in leave:
                yield name, _with_results(base, folder / "first" / name.replace(" ", "-"))


def _with_results(base, place):
    """The base with the output of its valid input; of a command without output as it is."""
    if "{out}" not in " ".join(base.arguments):
        return base
    outcome = call_valid(base, place)
    earlier = {
        str(Path(name).relative_to("out")): data
        for name, data in outcome.after.items()
        if name.startswith("out/")
    }
    return replace(base, earlier=earlier, valid=outcome)


def call_valid(base, place):
    """Outcome of the valid input of a base, which has no fault."""
    if base.valid is not None:
        return base.valid
    outcome = call(base, base.files, place)
    is_valid = outcome.status == 0 or (not base.complains and outcome.status in base.statuses)
    assert is_valid, (base.arguments, outcome.err, outcome.out, outcome.error)
    assert not (found := list_faults(base, outcome)), (base.arguments, found)
    return outcome


def read_example(name):
    """{path: bytes} of the text files of an example, with a coarse table."""
    files = {
        path: data
        for path, data in read_tree(EXAMPLES / name).items()
        if not path.endswith((".md", ".py", ".json")) and "/" not in path.replace("scans/", "")
    }
    for pattern, coarse in _STEPS if "job.toml" in files else ():
        files["job.toml"] = pattern.sub(coarse, files["job.toml"])
    return files


def _read_job(folder, **changes):
    return read_tree(write_folder(folder, job_parts(**changes)))


FULL = {
    "uncertainty": [("datum", 1.0, "mm", "B", "normal", 50), ("scale", 20, "ppm")],
    "deadwood": [("coil", 0.5, 1.0, -0.2, 0.01), ("manhole", 0.6, 1.2, 0.05, 0.01)],
    "bottom": [(x, y, -0.01 * x, 1.0) for x in (-4.0, -1.0, 1.0, 4.0) for y in (-4.0, 0.0, 4.0)],
    "roof": {},
    "courses": 2,
    "points_per_ring": 12,
    "sd_mm": 2.0,
}
LYING = {
    "kind": "horizontal",
    "deadwood": FULL["deadwood"],
    "settings": {"horizontal.tilt_mm_per_m": 5.0, "horizontal.dip_from_a_m": 5.0, **COARSE},
}
RUN = ("run", "{in}", "--no-papers", "--quiet", "--out", "{out}")
EXAMPLES_RUN = (
    "strapping", "reference-line", "rings", "sphere-straps", "liquid", "liquid-lying", "partial",
    "ship", "tangents", "total-station", "wall-hits", "silva-1995-photos", "cloud",
)  # fmt: skip


def _make_runs(folder):
    statuses = (0, 2, 3)
    jobs = {
        "points": _read_job(folder / "points", settings=COARSE, **FULL),
        "lying": _read_job(folder / "lying", **LYING),
        "sphere": _read_job(folder / "sphere", kind="sphere", settings=COARSE),
        "volumes": _read_job(folder / "volumes", settings=COARSE, courses=2,
                             bottom_volumes=[(0, 0, 0), (0.1, 10, 0.1)]),
        **{name: read_example(name) for name in EXAMPLES_RUN},
    }  # fmt: skip
    bases = {f"run {name}": Base(RUN, files, statuses=statuses) for name, files in jobs.items()}
    bases["run adjustment"] = Base(
        (*RUN, "--only", "adjustment"), jobs["total-station"], statuses=statuses
    )
    bases["run strict"] = Base((*RUN, "--strict", "--json"), jobs["points"], statuses=statuses,
                               complains=False)  # fmt: skip
    book = write_book(folder / "job.xlsx", job_parts(settings=COARSE, **FULL))
    bases["run workbook"] = Base(("run", "{in}/job.xlsx", *RUN[2:]),
                                 {"job.xlsx": book.read_bytes()}, statuses=statuses)  # fmt: skip
    small = _read_job(folder / "small", settings=COARSE, courses=2, points_per_ring=8)
    files = {f"{place}/{name}": data for place in ("a", "b") for name, data in small.items()}
    files["jobs.csv"] = b"job,name\na,first\nb,second\n"
    bases["batch"] = Base(
        ("batch", "{in}/jobs.csv", "--workers", "0", "--no-papers", "--quiet", "--out", "{out}"),
        files, statuses=statuses, keeps=False, complains=False,
    )  # fmt: skip
    bases["inspect"] = Base(
        ("inspect", "{in}", "--rule", "{in}/rule.toml", "--quiet", "--json"),
        small | _inspection_files(), statuses=statuses, complains=False,
    )  # fmt: skip
    return bases


def _inspection_files():
    rules = EXAMPLES.parent / "tankcal" / "products" / "inspection" / "rules"
    files = {path.name: path.read_bytes() for path in (EXAMPLES / "inspection").glob("*.csv")}
    return files | {"rule.toml": (rules / "api_653.toml").read_bytes()}


def _make_results(folder):
    """Commands on a folder of results."""
    job = write_folder(folder / "job", job_parts(settings=COARSE, courses=2, points_per_ring=8))
    assert cli.main(["run", str(job), "--no-papers", "--quiet"]) == 0
    record = {"record.json": (job / "results" / "record.json").read_bytes()}
    whole = read_tree(job)
    former = read_example("compare")
    new = folder / "new"
    write_tree(new, read_example("strapping"))
    assert cli.main(["run", str(new), "--no-papers", "--quiet"]) == 0
    comparing = former | {"new.json": (new / "results" / "record.json").read_bytes()}
    tall = [k / 20 for k in range(49)]
    solid = {"record.json": written_record(folder, tall, list(map(float, map(lying, tall))))
             .read_bytes()}  # fmt: skip
    profiles = EXAMPLES.parent / "tankcal" / "products" / "exports" / "shipped_profiles"
    profile = {"profile.toml": (profiles / "signet-9900.toml").read_bytes()}
    return {
        "verify": Base(("verify", "{in}/results", "--quiet"), whole, exact=tuple(whole),
                       complains=False),
        "verify json": Base(("verify", "{in}/results", "--hashes-only", "--json"), whole,
                            exact=tuple(whole), complains=False),
        "export": Base(("export", "{in}", "--profile", "{in}/profile.toml", "--out",
                        "{out}/t.csv"), solid | profile),
        "export csv": Base(("export", "{in}/record.json", "--profile", "csv", "--json", "--out",
                            "{out}/t.csv"), solid, complains=False),
        "assess": Base(("assess", "{in}", "--quiet", "--out", "{out}"), record, keeps=False,
                       complains=False),
        "lint record": Base(("lint", "{in}/record.json", "--json"), record, complains=False),
        "compare": Base(("compare", "{in}/former.toml", "{in}/new.json", "--quiet", "--json"),
                        comparing, complains=False),
        "compare text": Base(("compare", "{in}/former.toml", "{in}/new.json", "--quiet"),
                             comparing),
        "history": Base(("history", "{in}", "{in}/former.toml", "--quiet", "--json"),
                        {"a/record.json": comparing["new.json"], **former}, complains=False),
        "report": Base(("report", "{in}", "--quiet", "--out", "{out}"), record,
                       statuses=(0, 2)),
        "report inspection": Base(
            ("report", "{in}/inspection.json", "--quiet", "--out", "{out}"),
            {"inspection.json": json.dumps(plain_inspection()).encode()}),
        "inspect record": Base(("inspect", "{in}", "--quiet", "--json"),
                               record | _inspection_files(), statuses=(0, 2, 3),
                               complains=False),
        "camera parameters": Base(("camera", "parameters", "{in}/record.json", "--json"),
                                  _adjusted_record(folder / "adjusted"), complains=False),
    }  # fmt: skip


def _adjusted_record(folder):
    write_tree(folder, read_example("silva-1995-photos"))
    assert cli.main(["run", str(folder), "--only", "adjustment", "--no-papers", "--quiet"]) == 0
    return {"record.json": (folder / "results" / "record.json").read_bytes()}


TICKET = b"""
[ticket]
number = "2026-118"
date = 2026-05-03

[product]
name = "diesel"
correction = "D1250-04"
group = "products"
base = "20C"
density_kg_m3 = 835.2
density_is = "observed"
density_temperature_c = 27.5
sw_percent = 0.05

[opening]
dip_m = 2.317
water_dip_m = 0.012
temperature_c = 28.4
ambient_c = 25.0

[closing]
dip_m = 6.642
water_dip_m = 0.012
temperature_c = 31.2
ambient_c = 29.0

[compared]
quantity = "nsv_m3"
value = 680.0
U = 1.2
source = "meter"
"""
TICKETS = b"ticket,opening_dip_m,closing_dip_m,closing_temperature_c\na,2.1,5.2,30\nb,1.5,,28.5\n"

GAUGE = b"""
[certificate]
date = 2026-11-20

[gauge]
record = "record.json"
resolution_mm = 1
supported_by = "bottom"
lowest_m = 0.5
highest_m = 8.0

[limit]
source = "contract"
absolute_mm = 4
rule = "guarded"
"""
READINGS = b"level,dip_m,gauge_m\nlow,1.812,1.814\nmid,4.904,4.907\nhigh,7.731,7.735\n"


UPKEEP = b"""
[upkeep]
record = "record.json"
timezone = "UTC"
service = "terminal"

[liquid]
expansion_per_k = 0.0008
base_c = 15

[gauge]
resolution_mm = 1

[levels]
files = ["levels.csv"]

[meters]
files = ["sales.csv"]
"""


def _write_days():
    """Logs of four days of a terminal: an hour of flow each morning from a falling level."""
    levels, sales = ["time,level_mm,temperature_c"], ["time,meter,total_l"]
    for hour in range(96):
        day, clock = divmod(hour, 24)
        stamp, sold = f"2026-03-{day + 1:02d}T{clock:02d}", day + (clock > 8)
        sales.append(f"{stamp}:00:00,A,{100_000 * sold}")
        for minute in range(0, 60, 20):
            levels.append(f"{stamp}:{minute:02d}:00,{6000 - 500 * sold + minute % 3},15.5")
    texts = {"levels.csv": levels, "sales.csv": sales,
             "meters.csv": ["meter,u_factor_ppm,certificate", "A,300,C-1"]}  # fmt: skip
    return {name: "\n".join([*rows, ""]).encode() for name, rows in texts.items()}


def _make_quantities(folder):
    """Commands from the table of a record to the quantity."""
    write_tree(folder, read_example("strapping"))
    assert cli.main(["run", str(folder), "--no-papers", "--quiet"]) == 0
    record = {"record.json": (folder / "results" / "record.json").read_bytes()}
    ticket = record | {"ticket.toml": TICKET}
    gauge = record | {"gauge.toml": GAUGE, "readings.csv": READINGS}
    upkeep = record | {"upkeep.toml": UPKEEP, **_write_days()}
    command = ("ticket", "{in}/record.json", "{in}/ticket.toml")
    bases = {
        "ticket": Base((*command, "--json"), ticket, ("ticket.toml",), complains=False),
        "ticket record": Base((*command, "--json"), ticket, ("record.json",), complains=False),
        "ticket many": Base(
            (*command, "--tickets", "{in}/tickets.csv", "--out", "{out}/quantities.csv"),
            ticket | {"tickets.csv": TICKETS}, ("ticket.toml", "tickets.csv"), complains=False),
        "ticket document": Base((*command, "--quiet", "--out", "{out}"), ticket,
                                ("ticket.toml",), complains=False),
        "standard": Base(
            ("standard", *command[1:], "--temperatures", "15", "30", "--densities", "840",
             "--json", "--out", "{out}/standard.csv"), ticket, ("ticket.toml",), complains=False),
        "gauge": Base(("gauge", "{in}", "--json"), gauge, ("gauge.toml", "readings.csv"),
                      complains=False),
        "gauge certificate": Base(("gauge", "{in}", "--quiet", "--out", "{out}"), gauge,
                                  ("gauge.toml", "readings.csv"), complains=False),
        "upkeep": Base(("upkeep", "{in}", "--json"), upkeep,
                       ("upkeep.toml", "levels.csv", "meters.csv", "sales.csv"), complains=False),
        "chart": Base(("chart", "{in}/record.json", "--step-cm", "5", "--json", "--out",
                       "{out}/chart.pdf"), record, complains=False),
    }  # fmt: skip
    return {name: replace(base, exact=("record.json",)) for name, base in bases.items()}


def _make_plans(_):
    names = ("silva", "reference-line", "wall-hits", "tangents", "liquid", "triangulation")
    return {
        f"plan {name}": Base(("plan", "{in}", "--quiet"), read_example(f"plan-{name}"),
                             statuses=(0, 2, 3))
        for name in names
    }  # fmt: skip


def _make_tables(folder):
    rows = [(k / 20, AREA_M2 * k / 20) for k in range(60)]
    narrow = "height_m,volume_m3\n" + "".join(f"{h:.2f},{v:.4f}\n" for h, v in rows)
    wide = "cm,L,cm,L\n" + "".join(
        f"{k},{10 * AREA_M2 * k:.1f},{k + 60},{10 * AREA_M2 * (k + 60):.1f}\n" for k in range(60)
    )
    folder.mkdir(parents=True, exist_ok=True)
    solid = "dip_m,volume_m3\n" + "".join(f"{k / 20:.2f},{lying(k / 20):.3f}\n" for k in range(49))
    upright = read_example("former-table")
    lint = ("lint", "{in}/table.csv")
    read = ("read-table", "{in}/former.toml", "--courses", "{in}/courses.csv")
    return {
        "lint": Base(lint, {"table.csv": narrow.encode()}, complains=False),
        "lint PDF": Base(("lint", "{in}/table.pdf"), {"table.pdf": _pdf(folder, rows)},
                         complains=False),
        "lint wide": Base((*lint, "--json"), {"table.csv": wide.encode()}, complains=False),
        "lint workbook": Base(("lint", "{in}/table.xlsx"), {"table.xlsx": _book(folder, rows)},
                              complains=False),
        "read-table": Base((*read, "--out", "{out}"), upright, statuses=(0, 2, 3)),
        "read-table lying": Base(("read-table", "{in}/old.csv", "--kind", "horizontal"),
                                 {"old.csv": solid.encode()}, statuses=(0, 2, 3)),
    }  # fmt: skip


def _book(folder, rows):
    import xlsxwriter

    path = folder / "table.xlsx"
    with xlsxwriter.Workbook(path) as book:
        sheet = book.add_worksheet("table")
        sheet.write_row(0, 0, ["height_m", "volume_m3"])
        for number, row in enumerate(rows, 1):
            sheet.write_row(number, 0, row)
    return path.read_bytes()


def _pdf(folder, rows):
    words = [(50, 790, "height_m"), (150, 790, "volume_m3")]
    for number, (height, volume) in enumerate(rows):
        y = 778 - 12 * number
        words += [(50, y, f"{height:.2f}"), (150, y, f"{volume:.4f}")]
    return write_pdf([words], folder / "table.pdf").read_bytes()


def _make_imports(folder):
    job = read_tree(base_job(folder / "job"))
    survey = two_stands(hits=4)
    bases = {}
    for name, write in WRITERS.items():
        files = {f"job/{path}": data for path, data in job.items()}
        files[f"book.{name}"] = write(survey).encode()
        arguments = ["import", f"{{in}}/book.{name}", "--replace", "--out", "{out}"]
        if name == "csv":
            files["profile.toml"] = PROFILE.encode()
            arguments += ["--profile", "{in}/profile.toml"]
        arguments += ["--targets-mm", "1", "--targets-arcsec", "5"]
        spoilt = tuple(path for path in files if not path.startswith("job/"))
        bases[f"import {name}"] = Base(tuple(arguments), files, spoilt)
    points = "Ponto;Este (m);Norte (m);Altura (m)\n" + "".join(
        f"P{k};{6.5 * math.sin(k / 4):.4f};{6.5 * math.cos(k / 4):.4f};{1 + k % 3}\n".replace(
            ".", ","
        )
        for k in range(25)
    )
    bases["import list"] = Base(
        ("import", "{in}/list.csv", "--out", "{out}", "--yes", "--replace"),
        {"list.csv": points.encode()},
    )
    return bases


CONVERTED = {
    "metashape": """<?xml version="1.0" encoding="UTF-8"?>
<calibration>
  <projection>frame</projection>
  <width>4000</width>
  <height>3000</height>
  <f>3000.5</f>
  <cx>4.25</cx>
  <cy>-2</cy>
  <k1>-0.07</k1>
</calibration>
""",
    "colmap": "# Camera list\n1 SIMPLE_RADIAL 4000 3000 3000 2000 1500 -0.05\n",
    "aicon": "Ck -15\nXh 0.02\nYh 0\nA1 -3e-4\nR0 6\ncolumns 4000\nlines 3000\n",
    "opencv-json": '{"image_width": 4000, "image_height": 3000, "camera_matrix": [[3000.5, 0, '
    '2004.2], [0, 3000.5, 1497.5], [0, 0, 1]], "distortion_coefficients": [-0.07, 0, 0, 1e-4, 0]}',
}


def _make_cameras(_):
    seven = read_example("pessoa-2017")
    photos = read_example("silva-1995-photos")
    differences = "point,dx_m,dy_m,dz_m\n" + "".join(
        f"P{k},{0.01 * math.sin(k):.4f},{0.01 * math.cos(k):.4f},{0.02 * math.sin(3 * k):.4f}\n"
        for k in range(20)
    )
    found = {
        "camera compare": Base(("camera", "compare", "{in}/cameras.toml", "set1", "set2", "--json"),
                               seven, complains=False),
        "camera check": Base(("camera", "check", "{in}/check.csv", "--json"),
                             {"check.csv": differences.encode()}, complains=False),
        "camera influence": Base(("camera", "influence", "{in}", "--cameras", "{in}/others.toml",
                                  "--states", "fixed", "--json", "--quiet"),
                                 photos | {"others.toml": photos["cameras.toml"]},
                                 statuses=(0, 2, 3), complains=False),
    }  # fmt: skip
    if find_spec("cv2") is not None:
        found |= _camera_readings()
    for name, text in CONVERTED.items():
        to = "opencv" if name == "metashape" else "cameras.toml"
        found[f"camera convert {name}"] = Base(
            ("camera", "convert", "{in}/camera.txt", "--from", name, "--to", to, "--pixel-um", "5"),
            {"camera.txt": text.encode()},
        )
    return found


def _camera_readings():
    """Bases that read two targets in a photograph; they need OpenCV."""
    import cv2
    import numpy as np

    codes = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    image = np.full((160, 320), 220, np.uint8)
    for number, left in ((7, 30), (9, 180)):
        image[30:128, left : left + 98] = cv2.aruco.generateImageMarker(codes, number, 98)
    discs = np.full((160, 320), 40, np.uint8)
    for left in (80, 240):
        cv2.circle(discs, (left, 80), 15, 230, -1, cv2.LINE_AA)
    photo, circles = (
        cv2.imencode(".png", cv2.GaussianBlur(one, (5, 5), 1.0))[1].tobytes()
        for one in (image, discs)
    )
    read = ("camera", "read", "{in}/photo.png", "--quiet", "--out", "{out}/image_points.csv")
    places = b"photo,point,column_px,line_px\nphoto,A,81,79\nphoto,B,241,82\n"
    return {
        "camera read": Base((*read, "--names", "{in}/names.csv"),
                            {"photo.png": photo, "names.csv": b"id,point\n7,T7\n9,T9\n"}),
        "camera read circles": Base((*read, "--what", "circles", "--places", "{in}/places.csv"),
                                    {"photo.png": circles, "places.csv": places}),
    }  # fmt: skip


def _make_answers(folder):
    package, truth, manifest, sealed = written_package(folder)
    write_answers(folder / "answers", answers_of(manifest, sealed))
    files = {f"answers/{name}": data for name, data in read_tree(folder / "answers").items()}
    files["truth.json"] = truth.read_bytes()
    score = ("intercomparison", "score", "{in}/answers", "--truth", "{in}/truth.json")
    whole = {f"package/{name}": data for name, data in read_tree(package).items()}
    return {
        "score": Base((*score, "--quiet"), files, exact=("truth.json",)),
        "score json": Base((*score, "--json"), files, exact=("truth.json",), complains=False),
        "answer": Base(("intercomparison", "answer", "{in}/package", "--quiet", "--out", "{out}"),
                       whole, exact=tuple(whole)),
        "template": Base(("intercomparison", "template", "{in}/package", "--out", "{out}"),
                         whole, ("package/manifest.json",), tuple(whole)),
    }  # fmt: skip


# ---- what is compared


def list_accepted_falls(base, files, outcome):
    """Faults of a command that took a table whose volumes fall with height, with status 0."""
    if outcome.status:
        return []
    read = " ".join(base.arguments)
    tables = [(name, _volumes_in(name, data)) for name, data in files.items()]
    return [
        f"falling table of {name} accepted"
        for name, volumes in tables
        if (name in read or name in _TABLES) and any(b < a for a, b in pairwise(volumes))
    ]


_TABLES = ("record.json", "a/record.json", "former.csv", "old.csv")
_HEADINGS = ("height_m", "dip_m")


def _volumes_in(name, data):
    """Volumes of a record or of a CSV table in metres and cubic metres; []: of any other file."""
    try:
        text = data.decode("utf-8-sig")
        if name.endswith(".json"):
            return list(map(float, json.loads(text)["capacity"]["volume_m3"]))
        heading, *rows = [line.split(",") for line in text.splitlines()]
        if not name.endswith(".csv") or heading[1] != "volume_m3" or heading[0] not in _HEADINGS:
            return []
        numbers = [(float(row[0]), float(row[1])) for row in rows]
    except (ArithmeticError, ValueError, LookupError, TypeError, AttributeError):
        return []
    rises = all(b[0] > a[0] for a, b in pairwise(numbers))
    return [volume for _, volume in numbers] if rises else []


_NAMES = ("files", "warnings", "sha256", "file", "source", "tankcal", "versions", "out", "row",
          "manifest_sha256", "text", "left_out", "digest", "key")  # fmt: skip


def numbers_of(outcome):
    """Exit status, printed lines, tables and records, which a neutral change keeps."""
    if outcome.status:
        return outcome.status, _codes_in(outcome)
    written = {
        name: _content_of(data, outcome.place)
        for name, data in outcome.after.items()
        if name.startswith("out/") and name.endswith((".json", ".csv", ".toml", ".txt"))
    }
    return outcome.status, _content_of(outcome.out.encode(), outcome.place), written


def _codes_in(outcome):
    """Codes of the problems in JSON, else nothing: lines of text name rows and files."""
    return sorted(re.findall(r'"code": "(\w+)"', outcome.out))


def _content_of(data, place):
    text = data.decode(json.detect_encoding(data), errors="replace").replace(str(place), "")
    try:
        return _without_names(json.loads(text))
    except ValueError:
        return re.sub(r"[0-9a-f]{64}", "SHA-256", text)


def _without_names(saved):
    if isinstance(saved, dict):
        return {key: _without_names(one) for key, one in saved.items() if key not in _NAMES}
    return list(map(_without_names, saved)) if isinstance(saved, list) else saved
