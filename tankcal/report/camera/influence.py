"""Influence of calibrations on a survey: sentences, tables and rows for CSV files."""

from tankcal.report import blocks, numbers
from tankcal.report.camera.paper import shorten
from tankcal.report.camera.product import axes_table, decimals_of_axes, unit_of
from tankcal.report.camera.stability import DISTORTION, INTERIOR
from tankcal.report.tables import Column, Table
from tankcal.text.digits import NOTHING
from tankcal.text.words import list_names, observation_name

MOST_PAIRS, MOST_PAIRS_ON_TERMINAL = 40, 15


def summary(paper):
    """Blocks for the terminal: runs, their changes, check points, volumes and pairs."""
    return [
        *facts(paper),
        *runs(paper),
        *troubles(paper),
        *shifts(paper),
        *checks(paper),
        *volumes(paper),
        *pairs(paper, MOST_PAIRS_ON_TERMINAL),
    ]


def facts(paper):
    """Replaced camera, size of the survey, and number of rejected readings."""
    result = paper.result
    states = ", ".join(paper.words["states"].get(state, state) for state in result["states"])
    search = paper.text("not_searched")
    if result["search"]["searched"]:
        search = paper.text("searched", count=len(result["search"]["removed"]))
    return [
        paper.facts(
            [
                ("camera", result["camera"]),
                ("calibrations", list_names(paper.words, map(shorten, result["calibrations"]))),
                ("states", states),
                ("free", paper.parameters(result["free"])),
                ("photos", paper.number(result["photos"], decimals=0)),
                ("adjusted_points", paper.number(result["points"], decimals=0)),
                ("search", search),
            ]
        )
    ]


def label(paper, run):
    """Name of a run: the reference, or a calibration with its state."""
    if run["calibration"] is None:
        return paper.text("reference")
    state = paper.words["states"].get(run["state"], run["state"])
    return paper.text("run", name=shorten(run["calibration"]), state=state)


def list_adjusted_runs(paper):
    """Runs with an adjustment."""
    return [run for run in paper.result["runs"] if run["outcome"] == "adjusted"]


def runs(paper):
    """Table of the global test and the residuals of the images of each run."""
    rows = [_run_cells(paper, run) for run in paper.result["runs"]]
    with_images = [row for row in rows if row["largest_um"] is not None]
    in_pixels = bool(with_images) and all(row["rms_x_px"] is not None for row in with_images)
    unit, column = ("px", "px") if in_pixels else ("um", "um")
    columns = [
        Column("run"),
        Column("outcome", words="outcomes"),
        Column("sigma0", decimals=3),
        Column("passed", words="passed"),
        Column("redundancy", decimals=0),
        *(Column(f"rms_{axis}_{unit}", column, decimals=2) for axis in "xy"),
        Column(f"largest_{unit}", column, decimals=2, heading="largest_residual"),
        Column("largest_at"),
    ]
    return [paper.table("runs", rows, columns)]


def _run_cells(paper, run):
    """Cells of a run for its global test and the residuals of its images."""
    quality, images = run["quality"] or {}, run["images"] or {}
    row = {
        "run": label(paper, run),
        "outcome": run["outcome"],
        "sigma0": quality.get("sigma0"),
        "passed": quality.get("passed"),
        "redundancy": quality.get("redundancy"),
        "largest_um": images.get("largest_um"),
        "largest_px": images.get("largest_px"),
        "largest_at": None,
    }
    if images:
        row["largest_at"] = f"{images['largest_photo']}, {images['largest_point']}"
    for unit in ("um", "px"):
        values = images.get(f"rms_{unit}") or [None, None]
        row |= {f"rms_{axis}_{unit}": value for axis, value in zip("xy", values, strict=True)}
    return row


def troubles(paper):
    """Sentences about runs that failed, were skipped, have no volume, or have fixed parameters."""
    sentences = []
    for run in paper.result["runs"]:
        name = label(paper, run)
        if run["message"]:
            sentences.append(paper.text("run_failed", run=name, text=run["message"]))
        if run["skipped"]:
            code = run["skipped"]["code"]
            sentences.append(paper.words["skipped"].get(code, "{run}: " + code).format(run=name))
        if run["held"]:
            held = paper.parameters(run["held"])
            sentences.append(paper.text("run_held", run=name, names=held))
        if run["volume_failed"]:
            sentences.append(paper.text("run_no_volume", run=name, text=run["volume_failed"]))
    return [blocks.listing(sentences)] if sentences else []


def shifts(paper):
    """Table of the changes of points and photos against the reference."""
    rows = [
        _shift_cells(run["shifts"]) | {"run": label(paper, run)}
        for run in list_adjusted_runs(paper)
        if run["shifts"]
    ]
    if not rows:
        return [paper.paragraph("no_shifts")]
    content = [paper.show(SHIFTS, rows)]
    if any(run["shifts"] and run["shifts"]["aligned"] for run in list_adjusted_runs(paper)):
        content.append(paper.paragraph("aligned"))
    return content


SHIFTS = Table(
    "shifts",
    (
        Column("run", on="shifts"),
        Column("one", on="pairs_of_runs"),
        Column("other", on="pairs_of_runs"),
        *(Column(f"points_{axis}_mm", "image mm", decimals=3, on="shifts") for axis in "xyz"),
        Column("points_largest_mm", "image mm", decimals=3),
        Column("largest_point"),
        Column("photos_mm", "image mm", decimals=2),
        Column("photos_arcsec", "arcsec", decimals=1),
        Column("change_m3", "m3", decimals=4, heading="volume_change_m3", on="pairs_of_runs",
               optional=True),
    ),
)  # fmt: skip


def _shift_cells(shift):
    points, photos = shift["points"], shift["photos"]
    row = {f"points_{axis}_mm": v for axis, v in zip("xyz", points["rms_mm"], strict=True)}
    return row | {
        "points_largest_mm": points["largest_xyz_mm"],
        "largest_point": points["largest_point"],
        "photos_mm": photos["rms_xyz_mm"],
        "photos_arcsec": photos["rms_turn_arcsec"],
    }


def checks(paper):
    """Table of the check points of each run: bias of each axis, RMSE with and without it."""
    runs = [run for run in list_adjusted_runs(paper) if run["product"]]
    if not runs:
        return [paper.paragraph("no_check_points")]
    unit = "m" if "m" in {unit_of(run["product"]) for run in runs} else "mm"
    decimals = max(decimals_of_axes(run["product"], unit) for run in runs)
    rows = [
        row | {"run": label(paper, run) if number == 0 else ""}
        for run in runs
        for number, row in enumerate(run["product"]["axes"])
    ]
    level = paper.percent(runs[0]["product"]["alpha"])
    return [paper.show(axes_table(unit, decimals), rows, on="checks_of_runs", level=level)]


def volumes(paper):
    """Table of the volume of each run, and its difference from the reference."""
    runs = [run for run in list_adjusted_runs(paper) if run["volume"]]
    if not runs:
        return []
    rows = []
    for run in runs:
        change = (run["shifts"] or {}).get("volume") or {}
        rows.append(
            run["volume"]
            | {
                "run": label(paper, run),
                "change_m3": change.get("difference_m3"),
                "change_percent": change.get("percent"),
            }
        )
    columns = [
        Column("run"),
        Column("height_m", "m", height=True),
        Column("volume_m3", "m3", u="U_m3"),
        Column("U_m3", "m3", u="U_m3"),
        Column("change_m3", "m3", decimals=4, heading="volume_change_m3"),
        Column("change_percent", "percent", decimals=4, heading="relative"),
    ]
    return [paper.table("volumes_of_runs", rows, columns)]


def pairs(paper, most=MOST_PAIRS):
    """Table of pairs of runs, those with the largest changes of points first."""
    all_runs = paper.result["runs"]
    rows = [
        _shift_cells(pair)
        | {
            "one": label(paper, all_runs[pair["one"]]),
            "other": label(paper, all_runs[pair["other"]]),
            "change_m3": (pair["volume"] or {}).get("difference_m3"),
        }
        for pair in paper.result["pairs"]
        if pair["one"] != 0
        and not (all_runs[pair["one"]]["state"] == all_runs[pair["other"]]["state"] == "free")
    ]
    if not rows:
        return []
    rows.sort(key=lambda row: -(row["points_largest_mm"] or 0.0))
    if all(row["change_m3"] is None for row in rows):
        rows = [{key: row[key] for key in row if key != "change_m3"} for row in rows]
    shown = rows[:most]
    content = [paper.show(SHIFTS, shown, on="pairs_of_runs")]
    if len(rows) > len(shown):
        content.append(paper.paragraph("only_largest", shown=len(shown), all=len(rows)))
    return content


def rejections(paper):
    """Table of the readings that the reference rejected; no run uses them."""
    rows = [
        {
            "observation": observation_name(paper.words, row),
            "between": row["ids"],
            "w": row["w"],
            "file": row["file"],
            "row": row["row"],
        }
        for row in paper.result["search"]["removed"]
    ]
    if not rows:
        return []
    columns = [
        Column("observation"),
        Column("between"),
        Column("w", decimals=1),
        Column("file"),
        Column("row", decimals=0),
    ]
    return [paper.table("removed_of_reference", rows[:MOST_PAIRS], columns)]


# ---- interior orientation after each adjustment


def interiors(paper):
    """Tables of the interior parameters after each adjustment, and of different forms."""
    runs = [run for run in list_adjusted_runs(paper) if run["interior"]]
    units = {item["parameter"]: item["unit"] for run in runs for item in run["interior"]}
    parts = [[name for name in part if name in units] for part in (INTERIOR, *DISTORTION)]
    tables = [_interior_table(paper, runs, part, units) for part in parts if part]
    if len({(run["convention"], run["affinity"]) for run in runs}) > 1:
        tables.append(_forms_table(paper, runs))
    return tables


def _forms_table(paper, runs):
    """Table of the form of distortion of each run, which defines its parameters."""
    rows = [{**run, "run": label(paper, run)} for run in runs]
    columns = [
        Column("run"),
        Column("convention", words="short_conventions"),
        Column("affinity", words="affinities"),
    ]
    return paper.table("models_of_runs", rows, columns)


def _interior_table(paper, runs, names, units):
    rows = []
    for run in runs:
        values = {item["parameter"]: item for item in run["interior"]}
        cells = (_format_interior(paper, values.get(name)) for name in names)
        rows.append([label(paper, run), *cells])
    heads = [[paper.word("table_headings.run"), ""]]
    heads += [[paper.parameters([name]), numbers.powers(units[name] or "")] for name in names]
    align = ["left", *["right"] * len(names)]
    return blocks.table(heads, rows, paper.word("captions.interiors"), align)


def _format_interior(paper, item):
    """Text of a parameter with its standard deviation; NOTHING if it is not in the model."""
    if item is None:
        return NOTHING
    if not item["sd"]:
        return paper.plain(item["value"])
    return numbers.concise(item["value"], item["sd"], paper.marks)


# ---- CSV files


def tables(result):
    """Rows of the CSV files."""
    return {
        "runs.csv": [_run_row(run) for run in result["runs"]],
        "pairs.csv": [
            {key: result["runs"][pair[key]]["label"] for key in ("one", "other")} | _shift_row(pair)
            for pair in result["pairs"]
        ],
        "cameras.csv": [
            {"run": run["label"], **item}
            for run in result["runs"]
            for item in run["interior"] or []
        ],
        "axes.csv": [
            {"run": run["label"]} | {key: row[key] for key in row if key != "precision"}
            for run in result["runs"]
            for row in (run["product"] or {}).get("axes", [])
        ],
    }


def _run_row(run):
    quality = run["quality"] or {}
    row = {"run": run["label"]}
    row |= {key: run[key] for key in ("calibration", "state", "outcome", "message")}
    row |= {key: quality.get(key) for key in ("sigma0", "chi2", "redundancy", "passed")}
    row |= {key: (run["volume"] or {}).get(key) for key in ("volume_m3", "U_m3", "k", "height_m")}
    return row | _shift_row(run["shifts"])


def _shift_row(shift):
    """CSV cells of the changes between two runs; None without changes."""
    shift = shift or {}
    points, photos = shift.get("points", {}), shift.get("photos", {})
    volume = shift.get("volume") or {}
    row = {}
    for what, changes in (("points", points), ("photos", photos)):
        values = changes.get("rms_mm") or [None] * 3
        row |= {f"{what}_rms_{axis}_mm": v for axis, v in zip("xyz", values, strict=True)}
        row[f"{what}_largest_mm"] = changes.get("largest_xyz_mm")
    row["photos_rms_turn_arcsec"] = photos.get("rms_turn_arcsec")
    row["volume_difference_m3"] = volume.get("difference_m3")
    row["volume_difference_percent"] = volume.get("percent")
    return row
