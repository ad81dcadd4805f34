"""The figures of the working papers: the record's numbers, drawn by `tankcal.pipeline.plots`.

Each function takes a Paper and gives a matplotlib Figure, or a list of them when there are many
sections; the words at the axes are those of the paper's language.
"""

import numpy as np
from matplotlib.ticker import Formatter, ScalarFormatter

from tankcal.pipeline import plots
from tankcal.report.uncertainty.stated import stated_U_m3


def residuals(paper, most=8):
    """Residuals in mm against azimuth, one panel a section, up to `most` panels a figure."""
    return plots.residual_panels(_rings(paper), _words(paper), most)


def polar_factor(paper):
    """How many times larger than the tank the deviations of `polar` are drawn: 1, 2 or 5·10^n."""
    return plots.polar_factor(_rings(paper))


def polar(paper, most=12):
    """The sections about their circles, deviations enlarged by `polar_factor`."""
    return plots.polar(_rings(paper), _words(paper), most)


def deviation_map(paper):
    """The wall unrolled: azimuth by height, every accepted point coloured by its residual."""
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
    """Litres per centimetre, and U, against height."""
    capacity, words = paper.record["capacity"], _words(paper)
    U = [paper.volume_factor * one for one in stated_U_m3(capacity)]
    return plots.capacity_curves(
        capacity["height_m"],
        capacity["area_m2"],
        U,
        lambda name: words(name).replace("m³", paper.volume_symbol),
    )


def capacity_curves_name(paper):
    """Name of the caption: whether a bottom has a panel of its own."""
    of_bottom = plots.bottom_rows(paper.record["capacity"]["area_m2"])
    return "capacity_curves_bottom" if of_bottom else "capacity_curves"


def budget_bars(paper):
    """The share of the variance of each input, in percent; defaults are pale."""
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
    """The figure with this decimal mark in the numbers at its axes; names there stay."""
    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis):
            if isinstance(axis.get_major_formatter(), ScalarFormatter):
                axis.set_major_formatter(_Marked(axis.get_major_formatter(), mark))
            if isinstance(axis.get_minor_formatter(), ScalarFormatter):
                axis.set_minor_formatter(_Marked(axis.get_minor_formatter(), mark))
    return figure


class _Marked(Formatter):
    """The numbers of another formatter with a decimal mark."""

    def __init__(self, of_numbers, mark):
        self._of_numbers, self._mark = of_numbers, mark

    def __call__(self, x, pos=None):
        return self._of_numbers(x, pos).replace(".", self._mark)

    def get_offset(self):
        return self._of_numbers.get_offset().replace(".", self._mark)

    def set_locs(self, locs):
        self._of_numbers.set_locs(locs)
