"""A prediction for programs: plan.json, and CSV files with the units in their headings."""

from tankcal.record import save
from tankcal.record.plan import plain_of
from tankcal.report.planning.rows import place_of_change
from tankcal.text.delimited import write_guarded

PLACE = ("arc_m", "off_m", "height_m")  # of what a change adds


def write(paper, folder, fingerprints):
    """Write plan.json and the CSV files.

    fingerprints  [{file, sha256}] of the empty job, by which a filled one is told from it
    """
    found = plain_of(paper.prediction, paper.simulated, fingerprints)
    save(found, folder / "plan.json")
    for name, (headings, rows) in _tables(found).items():
        _write(folder / name, headings, rows)
    write_capacity(found, folder)
    write_effects(paper, folder)


def write_capacity(found, folder):
    """Write capacity.csv of the plain data of a plan."""
    table = found["table"]
    rows = zip(*table.values(), strict=True)
    _write(folder / "capacity.csv", " ".join(table), rows)


def write_effects(paper, folder):
    """Write changes.csv and design.csv, where there are any."""
    steps = () if paper.design is None else paper.design.steps
    for name, effects in (("changes.csv", paper.effects), ("design.csv", steps)):
        if effects:
            _write(
                folder / name,
                f"action item name {' '.join(PLACE)} cost relative_u difference U_m3 why",
                [
                    [one.change.action, one.change.item, one.change.name, *_place(one.change),
                     one.change.cost, one.relative_u, one.difference, one.U_m3, one.why]
                    for one in effects
                ],
            )  # fmt: skip


def _tables(found):
    """{file: (headings, rows)} of points and sections of a plan.json."""
    points = [
        [one["name"], one["rays"], *map(_mm, one["sd_m"]), one["undetermined"], one["weak"]]
        for one in found["points"]
    ]
    sections = [
        [one["name"], one["height_m"], one["targets"], *map(_mm, one["centre_sd_m"]),
         _mm(one["radius_sd_m"])]
        for one in found["sections"]
    ]  # fmt: skip
    return {
        "points.csv": ("point rays sx_mm sy_mm sz_mm undetermined weak", points),
        "sections.csv": (
            "section height_m targets centre_sx_mm centre_sy_mm radius_s_mm",
            sections,
        ),
    }


def _place(change):
    """Where what is added stands, as texts."""
    found = place_of_change(change)
    return [f"{found[key]:.3f}" if key in found else "" for key in PLACE]


def _mm(metres):
    return "" if metres is None else f"{1000 * metres:.4f}"


def _write(path, headings, rows):
    with open(path, "w", newline="", encoding="utf-8") as file:
        write_guarded(file, [headings.split(), *rows])
