"""How image coordinates came about: repeated readings, fiducial marks, depth of field."""

from tankcal.report.paper import Column
from tankcal.report.survey.common import MOST_ROWS, with_note


def images(paper):
    """Tables and sentences about readings, marks and depth; nothing where there were none."""
    return [*_readings(paper), *_fiducials(paper), *_depth(paper)]


def _readings(paper):
    found = paper.record["adjustment"]["image_readings"]
    if found is None:
        return []
    text = paper.paragraph(
        "repeated_readings",
        points=found["points"],
        readings=found["readings"],
        x=paper.number(found["mean_sd_x_um"], decimals=1),
        y=paper.number(found["mean_sd_y_um"], decimals=1),
    )
    if found["limit_um"] is None:
        return [text, paper.paragraph("no_reading_limit")]
    limit = paper.number(found["limit_um"], decimals=1)
    rejected = sorted(found["rejected"], key=lambda row: -max(row["sd_x_um"], row["sd_y_um"]))
    if not rejected:
        return [text, paper.paragraph("no_rejected_readings", limit=limit)]
    shown = rejected[:MOST_ROWS]
    columns = [Column("photo"), Column("point"), *_sds(), Column("row", decimals=0)]
    block = paper.table("rejected_readings", shown, columns, limit=limit)
    return [text, *with_note(paper, block, shown, rejected)]


def _sds():
    return [
        Column("n", decimals=0, heading="count_of_readings"),
        *(Column(f"sd_{axis}_um", "um", decimals=1) for axis in "xy"),
    ]


def _fiducials(paper):
    found = paper.record["adjustment"]["fiducials"]
    if not found:
        return []
    rows = [row | {"marks": len(row["marks"])} for row in found]
    shown = sorted(rows, key=lambda row: -row["largest_um"])[:MOST_ROWS]
    block = paper.table(
        "fiducials",
        shown,
        [
            Column("photo"),
            Column("transformation", words="transformations"),
            Column("marks", decimals=0),
            Column("largest_um", "um", decimals=1, heading="largest_residual"),
            Column("sigma0", decimals=2),
            Column("redundancy", decimals=0, heading="degrees_of_freedom"),
            Column("growth", decimals=2, heading="growth_of_sd"),
        ],
    )
    rejected = [row for one in found for row in one["rejected"]]
    blocks = with_note(paper, block, shown, rows)
    if rejected:
        columns = [Column("photo"), Column("mark"), *_sds(), Column("row", decimals=0)]
        blocks.append(paper.table("rejected_marks", rejected[:MOST_ROWS], columns))
    return blocks


def _depth(paper):
    found = paper.record["adjustment"]["depth_of_field"]
    if found is None:
        return []
    return [
        paper.paragraph(
            "depth_of_field",
            rounds=found["rounds"],
            largest=paper.number(found["largest_um"], digits=2),
            rms=paper.number(found["rms_um"], digits=2),
        )
    ]
