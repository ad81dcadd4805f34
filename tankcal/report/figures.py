"""Figures of the working papers, drawn by `tankcal.report.plots.figures` from the record.

Each function takes a Paper and returns a matplotlib Figure, or a list of figures if there are many
sections. The labels of the axes are in the language of the paper.
"""

import numpy as np
from matplotlib.ticker import Formatter, ScalarFormatter

from tankcal.report.plots import figures as plots
from tankcal.report.uncertainty.stated import stated_U_m3


def residuals(paper, most=8):
    """Residuals, mm, against azimuth: a panel per section, at most `most` panels per figure."""
    return plots.residual_panels(_rings(paper), _words(paper), most)


def polar_factor(paper):
    """Enlargement of the deviations in `polar`: 1, 2 or 5·10^n."""
    return plots.polar_factor(_rings(paper))


def polar(paper, most=12):
    """Outlines of the sections around their circles, deviations enlarged by `polar_factor`."""
    return plots.polar(_rings(paper), _words(paper), most)


def deviation_map(paper):
    """Map of the unrolled wall: each accepted point, coloured by its residual."""
    record = paper.record
    z_m = {point["point"]: point["z_m"] for point in record["points"]}
    names = [name for section in record["sections"] for name in section["points"]]
    height_m = np.array([z_m[name] for name in names]) - record["job"]["datum"]["bottom_z_m"]
    azimuth = [a for section in record["sections"] for a in section["azimuth_deg"]]
    residual_m = [r for section in record["sections"] for r in section["residual_m"]]
    joints = [course["bottom_m"] for course in record["courses"]]
    joints.append(record["courses"][-1]["top_m"])
    return plots.deviation_map(azimuth, height_m, residual_m, joints, _words(paper))


def capacity_curves(paper):
    """Litres per centimetre and U against height."""
    capacity, words = paper.record["capacity"], _words(paper)
    U = [paper.volume_factor * U_m3 for U_m3 in stated_U_m3(capacity)]
    return plots.capacity_curves(
        capacity["height_m"],
        capacity["area_m2"],
        U,
        lambda name: words(name).replace("m³", paper.volume_symbol),
    )


def capacity_curves_name(paper):
    """Key of the caption, which depends on whether the figure has a panel of the bottom."""
    has_bottom_panel = plots.bottom_rows(paper.record["capacity"]["area_m2"])
    return "capacity_curves_bottom" if has_bottom_panel else "capacity_curves"


def budget_bars(paper):
    """Share of each input in the variance, percent; defaults are pale."""
    bars = [
        (paper.input_name(row), row["share"], bool(row.get("is_default")))
        for row in paper.record["budget"]
    ]
    return plots.budget_bars(bars, _words(paper))


def _rings(paper):
    return [
        plots.Ring(
            section["section"],
            paper.number(section["height_m"], "m", decimals=3),
            section["radius_m"],
            section["azimuth_deg"],
            section["residual_m"],
            section["outline"]["azimuth_deg"],
            section["outline"]["radius_m"],
        )
        for section in paper.record["sections"]
    ]


def _words(paper):
    return lambda key, **values: paper.word(f"axes.{key}", **values)


def with_decimal_mark(figure, mark):
    """Set the decimal mark of the numbers at the axes; other labels remain unchanged."""
    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis):
            if isinstance(axis.get_major_formatter(), ScalarFormatter):
                axis.set_major_formatter(_Marked(axis.get_major_formatter(), mark))
            if isinstance(axis.get_minor_formatter(), ScalarFormatter):
                axis.set_minor_formatter(_Marked(axis.get_minor_formatter(), mark))
    return figure


class _Marked(Formatter):
    """Formatter that replaces the decimal mark of another formatter."""

    def __init__(self, formatter, mark):
        self._formatter, self._mark = formatter, mark

    def __call__(self, x, pos=None):
        return self._formatter(x, pos).replace(".", self._mark)

    def get_offset(self):
        return self._formatter.get_offset().replace(".", self._mark)

    def set_locs(self, locs):
        self._formatter.set_locs(locs)
