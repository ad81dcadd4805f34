"""Table with which an upkeep begins: a record, a foreign table, a drawing, or none.

Without a calibration, the sizes of a lying tank are unknowns with the accuracy of the drawing:

    V(h) = V_tank(h + z; D, L, depth, tilt) + a dV_ends + b dV_section,

where dV_ends is the effect of the other kind of end and dV_section that of a flatter section. The
sums of squares may have several minima, because tilt and zero are nearly alike: the search starts
with four tilts and zeros, and keeps all minima within 3.84 of the smallest chi-squared.
"""

import copy
import json
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tankcal import record as records
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.job.fields import Field, choice, number, positive
from tankcal.messages import message
from tankcal.products.quantity.table import TankTable
from tankcal.products.upkeep.causes import TableStock
from tankcal.products.upkeep.estimation import estimate
from tankcal.products.upkeep.saved import NO_STATE, UpkeepCause, UpkeepSolution, hash_arrays
from tankcal.tank.heads import End
from tankcal.tank.liquid.adjustment import ALIKE
from tankcal.tank.solids import LyingTank

WITHOUT_TABLE, SALES = "nothing", "sales"  # the word of a user, and the kind of start
JOB, RECORD, COURSES, FORMER = "job.toml", "record.json", "courses.csv", "former.toml"
STEEL_PER_K = 1.2e-5  # linear expansion of the shell
GRID_M = 0.005  # rows of the table of a drawing
STARTS = tuple((tilt, zero) for tilt in (-20.0, 20.0) for zero in (-20.0, 20.0))  # mm/m, mm
PASSES = 12  # largest number of Gauss-Newton iterations
SETTLED = 0.01  # largest change of the last iteration, in prior standard deviations
SAME_END = 0.1  # largest distance of an iteration from a minimum that is known
FORM_SHARE = 0.7  # sd of the kind of the ends, as a share of the change to the other kind
FLATTER_M = 0.005  # sd of the height of the section
ENDS = ("flat", "ellipsoidal", "spherical", "conical")
OTHER_END = {"ellipsoidal": "spherical", "spherical": "ellipsoidal", "conical": "spherical"}
CERTIFIED_RANGE = (0.15, 0.85)  # of the height, that the levels of a certified table reach
STOCK_PROBABILITY = 0.954499736  # of intervals with k = 2
_U = {"diameter": 25.0, "length": 120.0, "end_depth": 60.0, "tilt": 15.0, "zero": 10.0}
DRAWING = (
    Field("tank", "text", ""),
    positive("diameter_m", "", 10),
    positive("length_m", "without the ends", 60),
    choice("end", "", ENDS),
    number("end_depth_m", "", 0, 5),
    number("tilt_mm_per_m", "", -50, 50),
    number("dip_from_a_m", "", 0, 60),
    positive("u_diameter_mm", "", 500),
    positive("u_length_mm", "", 2000),
    positive("u_end_depth_mm", "", 1000),
    positive("u_tilt_mm_per_m", "", 50),
    positive("u_zero_mm", "", 500),
)


@dataclass(frozen=True)
class StartTable:
    """Record of a table in force.

    Attributes
    ----------
    kind : {"record", "table", "job", "drawing"}
    path : Path
        The record.
    files : tuple of Path
        Files from which it was computed, or the record.
    warnings : tuple of Message
    holder : TemporaryDirectory or None
        Folder of a computed record, which is removed with this object.
    """

    kind: str
    path: Path
    files: tuple
    warnings: tuple = ()
    holder: object = None


def open_start(source):
    """Return the record of a source; tables and jobs are computed by `read-table` and `run`.

    Parameters
    ----------
    source : Path
        record.json or its folder; a table of another laboratory (CSV, workbook, PDF, former.toml);
        a job folder or its job.toml, such as the sizes of a drawing.

    Returns
    -------
    StartTable or None
        None: no such file.

    Raises
    ------
    InputError
        With every problem of the table or of the job.
    SolutionError
        If the table does not determine its tank, or the job has no solution.
    """
    if source.is_dir():
        source = next((source / name for name in (RECORD, JOB) if (source / name).is_file()),
                      source)  # fmt: skip
    if not source.is_file():
        return None
    if source.suffix == ".json":
        return StartTable("record", source, (source,))
    from tankcal.job.loading import load
    from tankcal.pipeline.chain import run
    from tankcal.report.tables.facts import NOT_SURVEYED

    holder, warnings = tempfile.TemporaryDirectory(prefix="tankcal-"), ()
    folder, kind, files = source.parent, "job", ()
    if source.name != JOB:
        from tankcal.products.recalibration.read_table import read_table
        from tankcal.products.recalibration.table_job import write_job

        kind, files = "table", [source]
        courses, facts = (source.parent / name for name in (COURSES, FORMER))
        facts = None if facts == source or not facts.is_file() else facts
        read = read_table(source, courses if courses.is_file() else None, facts)
        if read.former.U_m3 is None:
            text = message("upkeep_table_without_u", "the table has no uncertainty; expected "
                           "U_percent (or U_m3) and k in former.toml")  # fmt: skip
            raise InputError(Problem(source.name, text))
        warnings, folder = read.warnings, Path(holder.name) / "job"
        write_job(read.job, folder)
        used = [source.parent / str(read.former.name).partition(" ")[0], courses, facts]
        files += [path for path in used if path and path.is_file() and path not in files]
    record = records.record_of(run(load(folder)))
    if kind == "job":
        files = [source, *(folder / entry["file"] for entry in record["files"]
                           if folder / entry["file"] != source)]  # fmt: skip
        choices = {entry["value"] for entry in record["choices"] if entry["code"] == "thickness"}
        kind = "drawing" if choices & NOT_SURVEYED else "job"
    path = Path(holder.name) / RECORD
    records.save(record, path)
    return StartTable(kind, path, tuple(files), tuple(warnings), holder)


# ---- without a calibration


class LyingStock(TableStock):
    """Stock of a lying tank whose sizes are unknowns; x are changes in standard deviations.

    Parameters
    ----------
    drawing : dict
        Section [drawing] of upkeep.toml.
    expansion_per_k, base_c : float
        As in `TableStock`.

    Attributes
    ----------
    at : ndarray, shape (c,)
        Changes at which volumes are linearised.
    """

    kind = "form"

    def __init__(self, drawing, expansion_per_k, base_c):
        self.expansion_per_k, self.base_c = expansion_per_k, base_c
        self.drawing = {key: value for key, value in drawing.items() if value is not None}
        self.end = self.drawing.get("end", "flat")
        depth, length = self.drawing.get("end_depth_m", 0.0), self.drawing["length_m"]
        self.nominal = {"diameter": self.drawing["diameter_m"], "length": length,
                        "end_depth": depth, "tilt": self.drawing.get("tilt_mm_per_m", 0.0) / 1000,
                        "zero": 0.0}  # fmt: skip
        keys_of_u = {name: f"u_{name}_mm" for name in _U} | {"tilt": "u_tilt_mm_per_m"}
        self.sd = {name: self.drawing.get(keys_of_u[name], u) / 1000 for name, u in _U.items()}
        if self.end == "flat" or not depth:
            self.end = "flat"
            del self.sd["end_depth"]
        self.dip = self.drawing.get("dip_from_a_m", length / 2)
        self.names = (*self.sd, "section", *(("end_form",) if self.end in OTHER_END else ()))
        grid = np.append(np.arange(0.0, self.nominal["diameter"], GRID_M), self.nominal["diameter"])
        count = len(grid)
        self.table = TankTable(
            self.drawing.get("tank", ""), "horizontal", grid, grid, np.zeros((count, 1)),
            np.full(count, np.inf), 0.0, base_c, STEEL_PER_K,
            digest=hash_arrays(json.dumps(self.drawing, sort_keys=True)),
        )  # fmt: skip
        self.at = np.zeros(len(self.names))
        self.table = self.linear = self._compute(self.at)

    def moved_to(self, x):
        """This stock, linearised at the changes x (c,)."""
        moved = copy.copy(self)
        moved.at, moved.linear = x, self._compute(x)
        moved.table = replace(self.table, digest=hash_arrays(self.table.digest, x))
        return moved

    def volume_m3(self, level_m, x):
        """Volume below levels (n,) of the tank with the changes x (c,)."""
        return self.linear.volume(level_m) + self.linear.factor(level_m) @ (x - self.at)

    def columns(self, level_m, x):
        """Columns (n, c) of the sizes at levels."""
        return self.linear.factor(level_m)

    def sizes(self, x):
        """{size: value} of the changes x, in m."""
        return {name: self.nominal[name] + sd * change
                for (name, sd), change in zip(self.sd.items(), x, strict=False)}  # fmt: skip

    def start_at(self, tilt_mm_m, zero_mm):
        """Changes x with a tilt and a zero."""
        x = np.zeros(len(self.names))
        for name, value in (("tilt", tilt_mm_m), ("zero", zero_mm)):
            x[self.names.index(name)] = (value / 1000 - self.nominal[name]) / self.sd[name]
        return x

    def _compute(self, x):
        """`TankTable` with the volumes and columns of the changes x."""
        grid, sizes = self.table.height_m, self.nominal | self.sizes(x)
        tank, level = self._place(sizes, self.end, grid)
        section, form = x[len(self.sd)], x[len(self.sd) + 1 :]
        volume, by_size = tank.volume_m3(level), tank.derivatives(level)
        is_inside = (level > 0) & (level < tank.top_m)
        columns = [sd * np.where(is_inside, by_size["datum"], 0.0) if name == "zero"
                   else sd * by_size[name] for name, sd in self.sd.items()]  # fmt: skip
        # A section that is flatter has less height and area, at a given width.
        squeeze = 1 - FLATTER_M / sizes["diameter"]
        flat = squeeze * tank.volume_m3(np.minimum(level / squeeze, tank.top_m)) - volume
        columns.append(flat)
        volume = volume + section * flat
        if len(form):
            other, at = self._place(sizes, OTHER_END[self.end], grid)
            columns.append(FORM_SHARE * (other.volume_m3(at) - tank.volume_m3(level)))
            volume = volume + form[0] * columns[-1]
        return replace(self.table, volume_m3=volume, factor_m3=np.stack(columns, axis=1))

    def _place(self, sizes, end, grid):
        """(tank, levels of the grid inside it)."""
        ends = End(end) if end == "flat" else End(end, max(sizes["end_depth"], 1e-3))
        try:
            tank = LyingTank(sizes["diameter"], sizes["diameter"], sizes["length"], ends, ends,
                             sizes["tilt"], dip_from_a_m=self.dip)  # fmt: skip
        except SolutionError as error:
            raise InputError(Problem("[drawing]", str(error))) from error
        return tank, np.clip(grid + sizes["zero"], 0.0, tank.top_m)


def check_drawing(drawing, report):
    """Report missing sizes of [drawing] with report(key, text)."""
    needed = ["diameter_m", "length_m"]
    if drawing["end"] not in (None, "flat"):
        needed.append("end_depth_m")
    for key in needed:
        if drawing[key] is None:
            report(f"drawing.{key}", message("upkeep_drawing", "missing; expected this size of the "
                 "drawing for an upkeep from {word}", word=WITHOUT_TABLE))  # fmt: skip
    dip, length = drawing["dip_from_a_m"], drawing["length_m"]
    if dip is not None and length is not None and dip > length:
        report("drawing.dip_from_a_m", message("upkeep_dip_outside", "expected at "
             "most the length of {most} m", most=length))  # fmt: skip


def estimate_sizes(operation, steps, state=NO_STATE):
    """Estimate a tank without calibration from four starts, by Gauss-Newton iterations.

    The sizes of a pass are constant over all its steps: a tilt that the first months do not show
    would otherwise be linearised at zero there, where its effect is quadratic.

    Parameters
    ----------
    operation : causes.Operation
        With a `LyingStock`.
    steps : steps.Steps
    state : state.State, optional

    Returns
    -------
    operation : causes.Operation
        With the stock at the estimates.
    best : estimation.Estimation
    solutions : list of saved.UpkeepSolution
        Minima within 3.84 of the smallest chi-squared, the smallest first.
    """
    stock, count = operation.stock, len(operation.stock.names)
    ends = []
    for tilt, zero in STARTS:
        x = stock.start_at(tilt, zero)
        for _ in range(PASSES):
            moved = replace(operation, stock=stock.moved_to(x))
            end = estimate(moved, steps, state=state)
            change = end.triangle.estimate[:count] - x
            x = x + change
            is_known = any(np.max(np.abs(x - other)) < SAME_END for other, _, _ in ends)
            if is_known or np.max(np.abs(change)) < SETTLED:
                break
        # Without convergence chi-squared is flat, and the last iterate is as good as another.
        if not is_known:
            ends.append((x, moved, end))
    ends.sort(key=lambda end: _chi2(end[2]))
    _, moved, best = ends[0]
    solutions = [_solution(end, stock, best) for _, _, end in ends
                 if _chi2(end) - _chi2(best) < ALIKE]  # fmt: skip
    return moved, best, solutions


def _chi2(estimation):
    """Sum of squares; a rejected step counts as one on the limit of rejection."""
    return estimation.triangle.chi2 + 16.0 * len(estimation.rejected)


def _solution(estimation, stock, best):
    """`UpkeepSolution` of an estimation."""
    count = len(stock.sd)
    x = estimation.triangle.estimate
    covariance = estimation.covariance[:count, :count]
    sd_left = np.sqrt(np.diag(covariance))
    sizes = [
        UpkeepCause(name, "form", "mm/m" if name == "tilt" else "mm", 1000 * stock.nominal[name],
                    1000 * sd, float(1000 * (stock.nominal[name] + sd * x[i])),
                    float(1000 * sd * sd_left[i]))
        for i, (name, sd) in enumerate(stock.sd.items())
    ]  # fmt: skip
    return UpkeepSolution(_chi2(estimation) - _chi2(best), sizes,
                          (covariance / np.outer(sd_left, sd_left)).tolist())  # fmt: skip
