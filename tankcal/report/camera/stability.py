"""Comparison of calibrations: sentences, tables and rows for CSV files."""

from tankcal.camera.model import KEYS, UNITS
from tankcal.report import blocks, numbers
from tankcal.report.camera.paper import number_names, shorten
from tankcal.report.plain import Column
from tankcal.text.digits import NOTHING, decimals_of, fixed

MOST_LISTED = 12  # pairs in a sentence
INTERIOR = ("c", "x0", "y0")
DISTORTION = (("K1", "K2", "K3", "K4"), ("P1", "P2", "P3", "P4", "A", "B"))
MOST_DECIMALS = 3  # of a figure in pixels; fewer if it scatters between terrains
_SAME = "\N{NO-BREAK SPACE}="
_NOT_SAME = "\N{NO-BREAK SPACE}\N{FIGURE SPACE}"


def summary(paper):
    """Blocks for the terminal: conventions, verdicts and pairs."""
    return [*method(paper), *verdicts(paper), *pairs(paper)]


def method(paper):
    """Method of the comparison, and its conventions."""
    result, grid = paper.result, paper.result["grid"]
    width, height = result["cameras"][0]["format_px"]
    facts = [
        ("method", paper.word(f"methods.{result['method']}")),
        ("published", paper.text("as_published" if result["as_published"] else "by_default")),
        (
            "grid",
            paper.text(
                "grid",
                columns=grid["columns"],
                rows=grid["rows"],
                x=paper.plain(grid["start_px"][0]),
                y=paper.plain(grid["start_px"][1]),
                step=paper.plain(grid["step_px"]),
                width=width,
                height=height,
            ),
        ),
        ("threshold", threshold(paper)),
    ]
    return [
        paper.facts(facts),
        blocks.listing(_convention(paper, c) for c in result["conventions"]),
    ]


def threshold(paper):
    """Threshold with its unit."""
    return paper.plain(paper.result["threshold_px"], "px")


def _convention(paper, convention):
    code = convention["code"]
    values = {
        key: _format_value(paper, key, value) for key, value in convention.items() if key != "code"
    }
    if code == "direction" and paper.result["method"] == "spr":
        code = "direction_spr"
    if code == "terrain_random":
        values["high_m"] = paper.plain(convention["low_m"] + convention["range_m"])
    return paper.word(f"conventions_of_comparison.{code}", **values)


def _format_value(paper, key, value):
    if key == "cameras":
        return ", ".join(map(shorten, value))
    if key == "position_m":
        return paper.text("position", **dict(zip("xyz", map(paper.plain, value), strict=True)))
    if key == "points":
        return paper.number(value, decimals=0)
    if isinstance(value, float):
        return paper.plain(value)
    return paper.words["ordinals"].get(value, str(value))


def verdicts(paper):
    """Sentences about all pairs, and about pairs explained by declared standard deviations."""
    rows = paper.result["pairs"]
    similar = sum(row["similar"] for row in rows)
    code = "verdicts"
    if similar in (0, len(rows)):
        code = "all_pairs_similar" if similar else "no_pair_similar"
    if len(rows) == 1:
        code = "one_pair_similar" if similar else "one_pair_different"
    content = [paper.paragraph(code, similar=similar, all=len(rows), threshold=threshold(paper))]
    # Without correlations, the expected figure is too large to explain a difference.
    conventions = {item["code"]: item for item in paper.result["conventions"]}
    known = set(conventions.get("covariance_known", {}).get("cameras", ()))
    explained = [
        f"{shorten(row['a'])} – {shorten(row['b'])}"
        for row in rows
        if {row["a"], row["b"]} <= known and row["figure_px"] <= row["expected_px"]
    ]
    if explained:
        more = len(explained) - MOST_LISTED
        names = "; ".join(explained[:MOST_LISTED])
        if more > 0:
            names = paper.text("and_more", names=names, more=more)
        content.append(paper.paragraph("within_expectation", pairs=names))
    return content


def matrix(paper):
    """Matrix of the figures, later sets in rows and earlier sets in columns, as published."""
    names = [camera["name"] for camera in paper.result["cameras"]]
    labels, heads = number_names(names)
    first = 0 if labels != heads else 1  # the first row explains the number of the first set
    figure = {frozenset((row["a"], row["b"])): row for row in paper.result["pairs"]}
    rows = []
    for i, later in enumerate(names[first:], first):
        cells = [figure.get(frozenset((earlier, later))) for earlier in names[:i]]
        rows.append(
            [labels[i], *(_figure_cell(paper, cell) for cell in cells), *[""] * (len(names) - i)]
        )
    caption = paper.word(
        "captions.matrix",
        method=paper.word(f"short_methods.{paper.result['method']}"),
        threshold=threshold(paper),
    )
    width = len(names)
    align = ["left", *["right"] * (width - 1)]
    return blocks.table(["", *heads[:-1]], [row[:width] for row in rows], caption, align)


def _figure_cell(paper, row):
    if row is None:
        return NOTHING
    decimals = min(decimals_of(row.get("scatter_px")), MOST_DECIMALS)
    return fixed(row["figure_px"], decimals, paper.marks) + (_SAME if row["similar"] else _NOT_SAME)


def pairs(paper):
    """Matrix of three sets or more, and a table with a row for each pair."""
    tables = [matrix(paper)] if len(paper.result["cameras"]) > 2 else []
    rows = [_pair_row(row) for row in paper.result["pairs"]]
    expected = any(row["expected_px"] is not None for row in rows)
    scattered = any(row["scatter_px"] is not None for row in rows)
    columns = [
        Column("a"),
        Column("b"),
        Column("figure_px", "px", u="scatter_px", most=MOST_DECIMALS, decimals=MOST_DECIMALS),
        *([Column("scatter_px", "px", decimals=MOST_DECIMALS)] if scattered else []),
        Column("similar", words="similar"),
        *([Column("expected_px", "px", decimals=3)] if expected else []),
        Column("largest_px", "px", decimals=2),
        Column("mean_px", "px", decimals=2),
        *_columns_of_method(rows),
    ]
    return [*tables, paper.table("pairs" if expected else "pairs_plain", rows, columns)]


def _columns_of_method(rows):
    """Columns of the scale, rotation and shift that a method estimates."""
    columns = {"scale": Column("scale", decimals=6)}
    for angle in ("omega_deg", "phi_deg", "kappa_deg"):
        columns[angle] = Column(angle, "deg arcsec", decimals=1)
    for shift in ("shift_x_m", "shift_y_m", "shift_z_m"):
        columns[shift] = Column(shift, "m", decimals=3)
    return [column for key, column in columns.items() if any(row[key] is not None for row in rows)]


def _pair_row(row):
    rotation = row["rotation_deg"] or [None] * 3
    shift = row["shift_m"] or [None] * 3
    angles = dict(zip(("omega_deg", "phi_deg", "kappa_deg"), rotation, strict=True))
    shifts = {f"shift_{axis}_m": value for axis, value in zip("xyz", shift, strict=True)}
    names = {key: shorten(row[key]) for key in "ab"}
    return {"scatter_px": None} | row | angles | shifts | names


def calibrations(paper):
    """Tables of the parameters of all calibrations, with standard deviations, and of models."""
    cameras = paper.result["cameras"]
    parts = [("interior", INTERIOR), *(("distortion", part) for part in DISTORTION)]
    values = [_values_table(paper, name, parameters) for name, parameters in parts]
    rows = [
        {
            "calibration": label,
            "convention": camera["convention"],
            "affinity": camera["affinity"],
            "frame": paper.text(
                "frame", width=camera["format_px"][0], height=camera["format_px"][1]
            ),
            "pixel": paper.text(
                "pixel", **dict(zip("xy", map(paper.plain, camera["pixel_um"]), strict=True))
            ),
        }
        for label, camera in zip(number_calibrations(paper), cameras, strict=True)
    ]
    columns = [
        Column("calibration"),
        Column("convention", words="short_conventions"),
        Column("affinity", words="affinities"),
        Column("frame"),
        Column("pixel"),
    ]
    return [*(table for table in values if table), paper.table("model", rows, columns)]


def number_calibrations(paper):
    """Names of the calibrations, with the numbers of the matrix, if any."""
    return number_names([camera["name"] for camera in paper.result["cameras"]])[0]


def _values_table(paper, name, parameters):
    """Table with a row for each calibration and a column for each parameter in use, or None."""
    cameras = paper.result["cameras"]
    used = [p for p in parameters if any(camera[KEYS[p]] for camera in cameras)]
    if not used:
        return None
    rows = [
        [label]
        + [numbers.concise(camera[KEYS[p]], camera["sd"][KEYS[p]], paper.marks) for p in used]
        for label, camera in zip(number_calibrations(paper), cameras, strict=True)
    ]
    heads = [[paper.word("table_headings.calibration"), ""]]
    heads += [[paper.word(f"parameters.{p}"), numbers.powers(UNITS[p])] for p in used]
    align = ["left", *["right"] * len(used)]
    return blocks.table(heads, rows, paper.word(f"captions.{name}"), align)


def remarks_on_bands(paper):
    """A sentence about the bands of the curves, if there are bands."""
    has_bands = any(camera["sd"][KEYS["K1"]] for camera in paper.result["cameras"])
    return [paper.paragraph("bands_uncorrelated")] if has_bands else []


def tables(result):
    """Rows of the CSV files."""
    return {
        "cameras.csv": [_camera_row(camera) for camera in result["cameras"]],
        "pairs.csv": [
            {
                key: value
                for key, value in _pair_row(row).items()
                if not (key.startswith("difference") or key in ("rotation_deg", "shift_m"))
            }
            | {"a": row["a"], "b": row["b"]}
            for row in result["pairs"]
        ],
    }


def _camera_row(camera):
    sds = {f"sd_{key}": value for key, value in camera["sd"].items()}
    values = {key: camera[key] for key in KEYS.values()}
    model = {key: camera[key] for key in ("convention", "affinity", "radial_balance_mm")}
    sizes = zip(("x", "y"), camera["format_px"], camera["pixel_um"], strict=True)
    frame = {}
    for axis, size, pixel in sizes:
        frame |= {f"format_{axis}_px": size, f"pixel_{axis}_um": pixel}
    return {"name": camera["name"], **values, **sds, **model, **frame}
