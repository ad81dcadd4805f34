"""Comparison of calibrations: its sentences, tables and rows for CSV files."""

from tankcal.camera.model import PARAMETERS, UNITS
from tankcal.report import blocks, numbers
from tankcal.report.camera.naming import numbered, short
from tankcal.report.plain import Column
from tankcal.text.digits import NOTHING, decimals_of, fixed

KEYS = {name: f"{name}_{UNITS[name]}" if UNITS[name] else name for name in PARAMETERS}
MOST_LISTED = 12  # pairs that a sentence lists
INTERIOR = ("c", "x0", "y0")
DISTORTION = (("K1", "K2", "K3", "K4"), ("P1", "P2", "P3", "P4", "A", "B"))
MOST_DECIMALS = 3  # of a figure in pixels; fewer where it scatters from terrain to terrain
_SAME = "\N{NO-BREAK SPACE}="
_NOT_SAME = "\N{NO-BREAK SPACE}\N{FIGURE SPACE}"


def summary(paper):
    """What the terminal shows: how it was compared, the verdicts, all pairs."""
    return [*method(paper), *verdicts(paper), *pairs(paper)]


def method(paper):
    """How the calibrations were compared, each convention named."""
    found, grid = paper.result, paper.result["grid"]
    width, height = found["cameras"][0]["format_px"]
    facts = [
        ("method", paper.word(f"methods.{found['method']}")),
        ("published", paper.text("as_published" if found["as_published"] else "by_default")),
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
    return [paper.facts(facts), blocks.listing(_convention(paper, c) for c in found["conventions"])]


def threshold(paper):
    """The threshold with its unit."""
    return paper.plain(paper.result["threshold_px"], "px")


def _convention(paper, convention):
    code = convention["code"]
    values = {key: _shown(paper, key, value) for key, value in convention.items() if key != "code"}
    if code == "direction" and paper.result["method"] == "spr":
        code = "direction_spr"
    if code == "terrain_random":
        values["high_m"] = paper.plain(convention["low_m"] + convention["range_m"])
    return paper.word(f"conventions_of_comparison.{code}", **values)


def _shown(paper, key, value):
    if key == "cameras":
        return ", ".join(short(name) for name in value)
    if key == "position_m":
        return paper.text("position", **dict(zip("xyz", map(paper.plain, value), strict=True)))
    if key == "points":
        return paper.number(value, decimals=0)
    if isinstance(value, float):
        return paper.plain(value)
    return paper.words["ordinals"].get(value, str(value))


def verdicts(paper):
    """One sentence on all pairs, and one on those that the declared sds explain."""
    rows = paper.result["pairs"]
    similar = sum(row["similar"] for row in rows)
    code = "verdicts"
    if similar in (0, len(rows)):
        code = "all_pairs_similar" if similar else "no_pair_similar"
    if len(rows) == 1:
        code = "one_pair_similar" if similar else "one_pair_different"
    found = [paper.paragraph(code, similar=similar, all=len(rows), threshold=threshold(paper))]
    known = _with_covariance(paper)
    explained = [
        f"{short(row['a'])} – {short(row['b'])}"
        for row in rows
        if {row["a"], row["b"]} <= known and row["figure_px"] <= row["expected_px"]
    ]
    if explained:
        more = len(explained) - MOST_LISTED
        names = "; ".join(explained[:MOST_LISTED])
        if more > 0:
            names = paper.text("and_more", names=names, more=more)
        found.append(paper.paragraph("within_expectation", pairs=names))
    return found


def _with_covariance(paper):
    """Names of the sets whose correlations are known; without them too much is explained."""
    conventions = {one["code"]: one for one in paper.result["conventions"]}
    return set(conventions.get("covariance_known", {}).get("cameras", ()))


def matrix(paper):
    """Rows the later set, columns the earlier ones, as in the published tables."""
    names = [camera["name"] for camera in paper.result["cameras"]]
    labels, heads = numbered(names)
    first = 0 if labels != heads else 1  # a number is explained by its row
    figure = {frozenset((row["a"], row["b"])): row for row in paper.result["pairs"]}
    rows = []
    for i, later in enumerate(names[first:], first):
        cells = [figure.get(frozenset((earlier, later))) for earlier in names[:i]]
        rows.append([labels[i], *(_cell(paper, cell) for cell in cells), *[""] * (len(names) - i)])
    caption = paper.word(
        "captions.matrix",
        method=paper.word(f"short_methods.{paper.result['method']}"),
        threshold=threshold(paper),
    )
    width = len(names)
    align = ["left", *["right"] * (width - 1)]
    return blocks.table(["", *heads[:-1]], [row[:width] for row in rows], caption, align)


def _cell(paper, row):
    if row is None:
        return NOTHING
    decimals = min(decimals_of(row.get("scatter_px")), MOST_DECIMALS)
    return fixed(row["figure_px"], decimals, paper.marks) + (_SAME if row["similar"] else _NOT_SAME)


def pairs(paper):
    """The matrix, where there are three sets or more, and one row for each pair."""
    drawn = [matrix(paper)] if len(paper.result["cameras"]) > 2 else []
    rows = [_row_of_pair(row) for row in paper.result["pairs"]]
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
    return [*drawn, paper.table("pairs" if expected else "pairs_plain", rows, columns)]


def _columns_of_method(rows):
    """Columns of what a method estimates beside the figure."""
    found = [("scale", Column("scale", decimals=6))]
    for angle in ("omega", "phi", "kappa"):
        found.append((f"{angle}_deg", Column(f"{angle}_deg", "deg arcsec", decimals=1)))
    for axis in "xyz":
        found.append((f"shift_{axis}_m", Column(f"shift_{axis}_m", "m", decimals=3)))
    return [column for key, column in found if any(row[key] is not None for row in rows)]


def _row_of_pair(row):
    rotation = row["rotation_deg"] or [None] * 3
    shift = row["shift_m"] or [None] * 3
    angles = dict(zip(("omega_deg", "phi_deg", "kappa_deg"), rotation, strict=True))
    shifts = {f"shift_{axis}_m": value for axis, value in zip("xyz", shift, strict=True)}
    return (
        {"scatter_px": None} | row | angles | shifts | {"a": short(row["a"]), "b": short(row["b"])}
    )


def calibrations(paper):
    """Tables of the values of every set, with their standard deviations."""
    cameras = paper.result["cameras"]
    parts = [("interior", INTERIOR), *(("distortion", part) for part in DISTORTION)]
    found = [_values(paper, name, keys) for name, keys in parts]
    rows = [
        {
            "calibration": label,
            "convention": camera["convention"],
            "affinity": camera["affinity"],
            "frame": paper.text(
                "frame", width=camera["format_px"][0], height=camera["format_px"][1]
            ),
            "pixel": paper.text("pixel", **_pixel(paper, camera)),
        }
        for label, camera in zip(numbered_labels(paper), cameras, strict=True)
    ]
    columns = [
        Column("calibration"),
        Column("convention", words="short_conventions"),
        Column("affinity", words="affinities"),
        Column("frame"),
        Column("pixel"),
    ]
    return [*(table for table in found if table), paper.table("model", rows, columns)]


def numbered_labels(paper):
    """The names of the calibrations, numbered where the matrix numbers them."""
    return numbered([camera["name"] for camera in paper.result["cameras"]])[0]


def _pixel(paper, camera):
    sides = (paper.plain(side) for side in camera["pixel_um"])
    return dict(zip("xy", sides, strict=True))


def _values(paper, name, parameters):
    """One row a calibration, one column a parameter that any of them has."""
    cameras = paper.result["cameras"]
    used = [p for p in parameters if any(camera[KEYS[p]] for camera in cameras)]
    if not used:
        return None
    rows = [
        [label]
        + [numbers.concise(camera[KEYS[p]], camera["sd"][KEYS[p]], paper.marks) for p in used]
        for label, camera in zip(numbered_labels(paper), cameras, strict=True)
    ]
    heads = [[paper.word("table_headings.calibration"), ""]]
    heads += [[paper.word(f"parameters.{p}"), numbers.powers(UNITS[p])] for p in used]
    align = ["left", *["right"] * len(used)]
    return blocks.table(heads, rows, paper.word(f"captions.{name}"), align)


def remarks_on_bands(paper):
    """A sentence on the bands of the curves, where there are any."""
    given = any(camera["sd"][KEYS["K1"]] for camera in paper.result["cameras"])
    return [paper.paragraph("bands_uncorrelated")] if given else []


def tables(result):
    """Rows of the CSV files."""
    return {
        "cameras.csv": [_camera_row(camera) for camera in result["cameras"]],
        "pairs.csv": [
            {key: value for key, value in _flat(row).items() if not key.startswith("difference")}
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


def _flat(pair):
    """A pair with its names as they are and its vectors one number a key."""
    names = {"a": pair["a"], "b": pair["b"]}
    row = _row_of_pair(pair) | names
    return {key: value for key, value in row.items() if key not in ("rotation_deg", "shift_m")}
