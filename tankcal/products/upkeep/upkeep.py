"""The upkeep of a tank: new table, meters, months, watching, omitted rows, and its verification."""

import hashlib
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import scipy.linalg

from tankcal.errors import Problem
from tankcal.gum.coverage import coverage_factor
from tankcal.messages import message
from tankcal.products.quantity.table import TankTable
from tankcal.products.recomputing import compare_values
from tankcal.products.settings import drop_blanks
from tankcal.products.upkeep import saved
from tankcal.products.upkeep.estimation import LEAST_RANGE, LEAST_STEPS, estimate
from tankcal.products.upkeep.filtering import whiten_steps
from tankcal.products.upkeep.reading import SETTINGS, read_upkeep
from tankcal.products.upkeep.saved import NO_STATE, UPKEEP
from tankcal.products.upkeep.start import (
    CERTIFIED_RANGE,
    SALES,
    STOCK_PROBABILITY,
    estimate_sizes,
)
from tankcal.products.upkeep.steps import REASONS
from tankcal.products.upkeep.watching import SIR_SD, suspect_clock, watch
from tankcal.record.covariance_factor import blocks_of
from tankcal.record.manifest import digest_of
from tankcal.record.schema import to_plain, warnings_of

WIDE = 0.005  # relative u of the former contents above which only deliveries are stated
GLOBAL_TEST = 1e-3  # least probability of chi-square for an improved table
SIR_LIMIT_L_H = 0.757  # 0.2 gal/h, the rate of inventory reconciliation (40 CFR 280.43)
ONE_SIDED = 1.645  # standard deviations of the 95 % quantile of the usual loss
WIDE_CHANGE = 1e3  # prior standard deviation of the change of a month, L/h or %
UNKNOWN = 0.9  # u after over u before, above which a cause is not determined
ROWS_SHOWN = 4  # deliveries between fifths of the seen levels
VARIANCE_RATIO = 2.0  # of observed and declared variances, beyond which a warning is given


def keep_up(inputs, state=NO_STATE, *, with_steps=False):
    """Estimate the table and the meters of a tank, and watch it.

    Parameters
    ----------
    inputs : reading.Inputs
    state : state.State, optional
        Results of earlier runs.
    with_steps : bool
        Whether the result has every step with its times, which show the throughput of each day.

    Returns
    -------
    saved.UpkeepFile
    """
    sections, warnings = inputs.sections, list(inputs.warnings)
    operation, estimation, solutions, probability = estimate_inputs(inputs, state)
    k = float(coverage_factor(probability, np.inf))
    ratio = estimation.triangle.chi2 / max(estimation.triangle.count, 1)
    scale = float(np.sqrt(max(ratio, 1.0)))
    if not 1 / VARIANCE_RATIO <= ratio <= VARIANCE_RATIO:
        text = message("upkeep_variances", "the innovations have {ratio:.2f} times the declared "
                       "variance; declare level_mm, gauge_wander_mm and the tickets in [priors] as "
                       "observed. U takes the larger variance", ratio=ratio)  # fmt: skip
        warnings.append(Problem(SETTINGS, text, column="priors"))
    watched = watch(estimation, sections["watch"]["false_alarm_per_year"] or 0.05, state)
    steps = inputs.steps
    if inputs.clock and watched.alarm_s is not None:
        watched = suspect_clock(watched, (inputs.clock[0] - steps.marks.time_ns[0]) * 1e-9,
                                inputs.clock[1])  # fmt: skip
    used = estimation.is_used
    levels = estimation.balance.level_m[np.append(used, False) | np.append(False, used)]
    low, high = (float(levels.min()), float(levels.max())) if len(levels) else (0.0, 0.0)
    reasons = _list_reasons(inputs, estimation, low, high)
    reasons += ["alarm"] if watched.alarm_s is not None else []
    mode = "improved"
    if {"few_steps", "small_range", "global_test", "outliers", "alarm"} & set(reasons):
        mode = "watched"
    elif {"wide_former", "stock_contents"} & set(reasons):
        mode = "deliveries"
    update = TableUpdate(inputs.table, inputs.table, low, high, k)
    if mode != "watched":
        volume, factor = update_table(estimation, operation.stock, low, high)
        update = replace(
            update, new=replace(inputs.table, volume_m3=volume, factor_m3=scale * factor)
        )
    # Without a former table, deliveries are all that can be stated of the contents.
    is_shown = (mode == "deliveries") == (inputs.start == SALES)
    return saved.UpkeepFile(
        notice=sections["upkeep"]["notice"] or "",
        tank=inputs.table.tank,
        record_sha256=inputs.table.digest,
        coverage_probability=probability,
        k=k,
        **{name: sections["upkeep"][name] for name in ("site", "by", "note", "service")},
        liquid=sections["liquid"]["name"],
        start=saved.UpkeepStart(
            inputs.start, bool({"stock_meter", "stock_range"} & set(reasons)), solutions
        ),
        mode=mode,
        reasons=reasons,
        period=saved.UpkeepPeriod(
            steps.day(0.0), steps.day(np.sum(steps.seconds)), float(np.sum(steps.seconds) / 86400),
            inputs.pieces, len(steps), int(used.sum()), len(estimation.rejected), low, high,
            float(steps.sold_m3.sum()), float(steps.delivered_m3.sum()),
        ),
        fit=saved.UpkeepFit(estimation.triangle.chi2, estimation.triangle.count,
                            estimation.probability, estimation.passes, scale),
        rows=update.rows() if is_shown else [],
        factor=blocks_of(update.new.factor_m3) if is_shown else [],
        deliveries=update.deliveries(),
        meters=_meters(estimation, operation, inputs, update, scale),
        causes=_causes(estimation),
        months=_months(estimation, steps.marks.time_ns[0], k, scale),
        watch=watched.to_save(steps.day),
        # Times to the hour, so that no single sale shows.
        cleaning=[saved.UpkeepCount(log, kind, entry[0], *map(_hour, entry[1:]))
                  for (log, kind), entry in sorted(inputs.findings.counts.items())],
        left_out=[
            saved.UpkeepCount("steps", REASONS[code], int(np.sum(steps.reason == code)), None, None)
            for code in range(1, len(REASONS)) if np.any(steps.reason == code)
        ],
        inputs=drop_blanks(sections),
        files=_chain(inputs.sources),
        warnings=warnings_of(warnings),
        steps=list_steps(operation, estimation) if with_steps else None,
    )  # fmt: skip


def estimate_inputs(inputs, state=NO_STATE):
    """Estimate a tank from its inputs.

    Returns
    -------
    operation : causes.Operation
    estimation : estimation.Estimation
    solutions : list of saved.UpkeepSolution
    probability : float
        Coverage probability of all U.
    """
    operation, declared = inputs.operation_of_meters(), inputs.sections["upkeep"]
    probability = declared["coverage_probability"]
    if inputs.start == SALES:
        solved = estimate_sizes(operation, inputs.steps, state)
        return *solved, probability or STOCK_PROBABILITY
    return operation, estimate(operation, inputs.steps, state=state), [], probability or 0.95


def update_table(estimation, stock, low_m, high_m):
    """New volumes and their covariance factor at the rows of the table.

    Rows between the levels of the steps take the estimates x of the causes of the table, with
    columns C and cov(x) = P afterwards. Rows above keep the increments of the former table, and
    rows below its shape:

        V_new(h) = V(h) + s(h) C(h') x,      h' = h within the levels, otherwise their end,

    with s = V(h) / V(h') below and 1 elsewhere. The true x is the sum of its estimate, with
    covariance I - P, and of an independent error with covariance P, so that the error is

        C(h) P^1/2,  [C(h) - s C(h')] (I - P)^1/2.

    Parameters
    ----------
    estimation : estimation.Estimation
    stock : causes.TableStock or start.LyingStock
    low_m, high_m : float
        Levels of the used steps.

    Returns
    -------
    volume : ndarray, shape (rows,)
    factor : ndarray, shape (rows, q)
    """
    table, count = stock.table, len(stock.names)
    x, covariance = estimation.triangle.estimate[:count], estimation.covariance[:count, :count]
    held = np.clip(table.height_m, low_m, high_m)
    columns, at_ends = stock.columns(table.height_m, x), stock.columns(held, x)
    below = table.height_m < low_m
    share = np.where(below, table.volume_m3 / table.volume(np.array([low_m]))[0], 1.0)
    moved = share[:, None] * at_ends
    inside = scipy.linalg.cholesky(covariance, lower=True)
    sizes, axes = np.linalg.eigh(np.eye(count) - covariance)
    known = axes * np.sqrt(np.maximum(sizes, 0.0))
    factor = np.hstack([columns @ inside, (columns - moved) @ known])
    change = share * (stock.volume_m3(held, x) - table.volume(held))
    return table.volume_m3 + change, factor


def _list_reasons(inputs, estimation, low, high):
    """Codes of shortcomings of the data of levels from low to high, in the order of the report.

    A tank whose table comes from its sales has no former table and no calibration by meters, but
    its own limits.
    """
    table, is_free, causes = inputs.table, inputs.start == SALES, estimation.balance.causes
    is_seen = (table.height_m >= low) & (table.height_m <= high)
    former_u = np.linalg.norm(table.factor_m3[is_seen], axis=1) / table.volume_m3[is_seen]
    bottom, top = table.height_m[-1] * np.array(CERTIFIED_RANGE)
    is_zero = np.array(causes.names) == "gauge_zero"
    codes = {
        "few_steps": estimation.triangle.count < LEAST_STEPS,
        "small_range": high - low < LEAST_RANGE * np.ptp(table.height_m),
        "outliers": not estimation.is_fitting,
        "global_test": estimation.probability < GLOBAL_TEST,
        # a drawing does not know the volume below the levels
        "wide_former": not is_free
        and (inputs.start == "drawing" or (np.any(is_seen) and np.median(former_u) > WIDE)),
        "stock_meter" if is_free else "no_traceable_meter": not inputs.traceable,
        "stock_range": is_free and not (low <= bottom and high >= top),
        "stock_contents": is_free,
        "zero": np.any(estimation.sizes()[1][is_zero] > UNKNOWN * causes.sd[is_zero]),
        "tilt": is_free,
    }
    return [code for code, applies in codes.items() if applies]


@dataclass(frozen=True)
class TableUpdate:
    """The table in force and the new one; both are equal if the tank is only watched.

    Attributes
    ----------
    former, new : TankTable
    low_m, high_m : float
        Levels of the used steps.
    k : float
        Coverage factor.
    """

    former: TankTable
    new: TankTable
    low_m: float
    high_m: float
    k: float

    def rows(self):
        """Rows of both tables with U and E_n (list of saved.UpkeepRow)."""
        former_U, U = (self.k * np.linalg.norm(table.factor_m3, axis=1)
                       for table in (self.former, self.new))  # fmt: skip
        height, former, new = self.former.height_m, self.former.volume_m3, self.new.volume_m3
        return [
            saved.UpkeepRow(*map(float, (height[i], former[i], former_U[i], new[i], U[i])),
                            _error_ratio(new[i] - former[i], former_U[i], U[i]),
                            bool(self.low_m <= height[i] <= self.high_m))
            for i in range(len(height))
        ]  # fmt: skip

    def deliveries(self):
        """Deliveries between fifths of the levels of the steps, and over all of them."""
        edges = np.linspace(self.low_m, self.high_m, ROWS_SHOWN + 2)
        result = []
        for ends in (*pairwise(edges), (self.low_m, self.high_m)):
            values = [float(end) for end in ends]
            for table in (self.former, self.new):
                spread = np.linalg.norm(np.diff(table.factor(np.array(ends)), axis=0))
                values += [float(np.diff(table.volume(np.array(ends)))[0]), float(self.k * spread)]
            result.append(saved.UpkeepDelivery(*values))
        return result


def _error_ratio(change, former_U, U):
    """E_n of a table that contains the former table: change / sqrt(U_old^2 - U_new^2)."""
    difference = former_U**2 - U**2
    return float(change / np.sqrt(difference)) if difference > 1e-12 * former_U**2 else None


def _meters(estimation, operation, inputs, update, scale):
    """Meters by the tank, with the correlation to the table between the levels of the steps."""
    causes, covariance = estimation.balance.causes, estimation.covariance
    count, ends = len(operation.stock.names), np.array([update.low_m, update.high_m])
    k, x = update.k, estimation.triangle.estimate
    between = np.zeros(len(x))
    between[:count] = np.diff(operation.stock.columns(ends, x[:count]), axis=0)[0]
    sd_table = np.sqrt(max(between @ covariance @ between, 1e-300))
    common, meters = causes.place("meters"), []
    for place in causes.place("meter"):
        name = causes.names[place].removeprefix("meter ")
        weights = np.zeros(len(x))
        weights[place] = causes.sd[place]
        weights[common] = causes.sd[common]
        sd = np.sqrt(weights @ covariance @ weights)
        metered = inputs.steps.sold_m3[:, inputs.steps.meters.index(name)].sum()
        meters.append(
            saved.UpkeepMeter(
                name, float(metered), inputs.traceable.get(name),
                float(k * np.linalg.norm(weights)), float(weights @ x), float(k * scale * sd),
                float(weights @ covariance @ between / sd / sd_table),
            )
        )  # fmt: skip
    return meters


def list_steps(operation, estimation):
    """Every step at the levels as read, by the table in force.

    Parameters
    ----------
    operation : causes.Operation
    estimation : estimation.Estimation

    Returns
    -------
    list of saved.UpkeepStep
    """
    steps = estimation.steps
    change, metered, delivered = operation.split_steps(steps)
    balance = operation.linearize(steps)
    losses = delivered - metered - change - balance.misclosure_m3
    # Without a use of any step, the filter has the variances by the causes that drift alone.
    drift = replace(balance.drift, is_used=np.zeros(len(steps), dtype=bool))
    gains = whiten_steps(drift, balance.columns_m3[:, :1]).gains
    variance = np.einsum("ni,nij,nj->n", gains.effect, gains.covariance, gains.effect)
    u = np.sqrt(variance + drift.noise_m3**2 + np.sum(balance.columns_m3**2, axis=1))
    kinds = np.where(steps.tickets > 0, 2, np.where(metered > 0, 1, 0))
    left_out = [REASONS[code] or None for code in steps.reason]
    for place in estimation.rejected:
        left_out[place] = "outlier"
    times = np.datetime_as_string(steps.marks.time_ns.view("datetime64[ns]"), unit="s").tolist()
    columns = (values.tolist() for values in (change, metered, delivered, losses,
                                              balance.misclosure_m3, u))  # fmt: skip
    return [
        saved.UpkeepStep(first, last, saved.STEP_KINDS[kind], *numbers,
                         float(w) if reason is None else None, reason)
        for (first, last), kind, *numbers, w, reason in zip(
            pairwise(times), kinds, *columns, estimation.innovations, left_out, strict=True)
    ]  # fmt: skip


def _causes(estimation):
    """Causes other than those of the table."""
    causes, (size, u) = estimation.balance.causes, estimation.sizes()
    return [
        saved.UpkeepCause(causes.names[i], causes.kinds[i], causes.units[i], float(causes.mean[i]),
                          float(causes.sd[i]), float(size[i]), float(u[i]))
        for i in range(len(causes.names)) if causes.kinds[i] not in ("table", "form")
    ]  # fmt: skip


def _months(estimation, start_ns, k, scale):
    """Leak and throughput of each month, all months jointly with the constant causes.

    The changes of all months are unknowns together, so that a loss that goes on is a loss in every
    month, and no later month takes it for normal.
    """
    steps, drift = estimation.steps, estimation.balance.drift
    ends = (steps.marks.time_ns[1:]).view("datetime64[ns]").astype("datetime64[M]")
    months = np.unique(ends)
    count, number = len(months), np.searchsorted(months, ends)
    columns, step = np.zeros((len(steps), 2 * count)), np.arange(len(steps))
    columns[step, number] = drift.seconds / 3.6e6
    columns[step, count + number] = drift.metered_m3.sum(axis=1) / 100
    white = whiten_steps(drift, columns).rows
    del columns
    causes = estimation.balance.causes
    (place,) = causes.place("loss") if len(causes.place("loss")) else (None,)
    # The loss by time is that of each month alone; its prior is used in the verdict.
    rows = estimation.rows if place is None else np.delete(estimation.rows, 1 + place, axis=1)
    changes, covariance = _fit_months(rows, white)
    mean, spread = (0.0, 0.0) if place is None else (causes.mean[place], causes.sd[place])
    # Throughput less the mean of all months, which is not separable from the meters.
    centre = np.eye(2 * count)
    if count > 1:
        centre[count:, count:] -= 1 / count
    sizes = centre @ changes + np.repeat([mean, 0.0], count)
    variances = np.einsum("ij,jk,ik->i", centre, covariance, centre)
    sd = scale * np.sqrt(variances)
    usual = mean + ONE_SIDED * spread
    result = []
    for i, month in enumerate(months):
        detectable = SIR_SD * sd[i]
        verdict = "inconclusive"
        if detectable <= SIR_LIMIT_L_H:
            verdict = "fail" if sizes[i] > usual + detectable / 2 else "pass"
        if sizes[i] < -detectable / 2:
            verdict = "gain"
        result.append(
            saved.UpkeepMonth(
                str(month), int(np.sum(estimation.is_used & (number == i))), float(sizes[i]),
                float(k * sd[i]), float(detectable) if detectable < 1e3 else None, verdict,
                float(sizes[count + i]), float(k * sd[count + i]),
            )
        )  # fmt: skip
    return result


def _fit_months(rows, columns):
    """Sizes (months,) and covariance (months, months) of the changes of all months.

    rows: (n, 1 + c), columns: (n, months), whitened.
    """
    count = rows.shape[1] - 1
    # Normal equations of all unknowns; the blocks need no copy of the columns.
    both = rows.T @ columns
    normal = np.block([[rows[:, 1:].T @ rows[:, 1:], both[1:]], [both[1:].T, columns.T @ columns]])
    prior = np.append(np.ones(count), np.full(columns.shape[1], WIDE_CHANGE**-2))
    inverse = np.linalg.inv(normal + np.diag(prior))
    sizes = inverse @ np.append(rows[:, 1:].T @ rows[:, 0], both[0])
    return sizes[count:], inverse[count:, count:]


def _hour(time_ns):
    """Text of a time to the hour; None without a time."""
    return None if time_ns is None else str(np.datetime64(time_ns, "ns").astype("datetime64[h]"))


def _chain(sources):
    """Files with the hash of their chain: each contains the hash before."""
    chain, files = "", []
    for source in sources:
        chain = hashlib.sha256(f"{chain}{source.sha256}".encode()).hexdigest()
        files.append(saved.UpkeepSource(
            source.kind, source.file, source.sha256, source.rows, _hour(source.first_ns),
            _hour(source.last_ns), chain))  # fmt: skip
    return files


def compute_again(saved, folder):
    """Compute a saved upkeep again from its logs.

    Parameters
    ----------
    saved : dict
        Content of upkeep.json.
    folder : Path
        Folder of the input files.

    Returns
    -------
    count : int or None
        Number of the compared values; None: the inputs are not in the folder.
    problems : list of Problem
        Differences.
    notes : list of Message
        Checks that were not possible.

    Raises
    ------
    InputError
        If the inputs are not those of an upkeep.
    """
    settings = Path(folder) / SETTINGS
    digests = {file["sha256"] for file in saved["files"] if file["file"] == SETTINGS}
    if not settings.is_file() or digest_of(settings) not in digests:
        note = message(
            "verify_upkeep_inputs",
            "{folder} does not contain {settings} with the SHA-256 stated in {file}; the values "
            "were not computed again",
            folder=str(folder),
            settings=SETTINGS,
            file=UPKEEP.file,
        )
        return None, [], [note]
    inputs = read_upkeep(settings, source=saved["inputs"]["upkeep"]["record"])
    again = to_plain(keep_up(inputs, with_steps="steps" in saved))
    return *compare_values(UPKEEP.file, _drop_texts(saved), _drop_texts(again)), []


def _drop_texts(upkeep):
    """Content of upkeep.json, without its version and the English texts of warnings."""
    keys = ("file", "column", "code", "values")
    warnings = [{key: warning[key] for key in keys} for warning in upkeep["warnings"]]
    return {**upkeep, "warnings": warnings, "tankcal": ""}
