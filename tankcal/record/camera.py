"""Analyses of cameras in camera.json: parameters, stability, and a product at check points.

Kind "parameters", significance of the parameters: codes of `recommendation[].reasons`
--------------------------------------------------------------------------------------

    principal            c belongs to every camera
    significant          {F, critical}
    not_significant      {F, critical}
    effect_above         {edge_um, edge_px, limit_um, limit_px}
    effect_below         {edge_um, edge_px, limit_um, limit_px}
    effect_not_known     no image accuracy for comparison
    significant_but_tiny            test and effect disagree
    insignificant_but_large {left_um, left_px}  test and effect disagree; left: remaining effect in
                         the corner after compensation by other parameters
    correlated           {with, correlation}
    group_significant    {names, F, critical}: it may be dropped alone, but not the whole group
    lower_order          {of []}: kept since these higher terms are kept
    known_beforehand     its value was declared with an sd: the test includes both
    product_stays        {largest_sds, largest_mm, volume_change_m3, volume_u_m3}
    product_moves        {largest_sds, largest_mm, volume_change_m3, volume_u_m3}
    not_with_the_others  it may be dropped alone; together with others the product changes
    product_not_tried    no further adjustment: it is kept until the product is tested
    not_determined_without {text, [names]}
    corner_not_seen      {reach_mm, corner_mm, seen_um, seen_px}: image points do not reach the
                         corner, where the effect is extrapolated
    together_stay, together_move  {names, largest_sds, largest_mm, volume_change_m3, volume_u_m3}:
                         all removable parameters, dropped at once

Kind "stability", comparison of calibrations: codes of `conventions`
-------------------------------------------------------------------

The choices on which a figure depends, in their order:

    figure_rmse | figure_mean_distance | figure_sigma0 {points, unknowns}
        sqrt(mean(dx2 + dy2)); mean(hypot(dx, dy)); sqrt(v'v / (2 points - unknowns))
    focal_as_they_are     image points compared without scaling (mis)
    focal_own             each bundle has the focal length of its set (rot, spr)
    focal_scaled {of, to} second set scaled by c of the first / c of the second (zrot)
    focal_same {of}       both bundles have the focal length of the first set (rot)
    direction {from, to}  second set transformed to the first; of spr: object points from the first
                          set, resection of the second
    pixel {x_um, y_um}    a pixel of this size, each axis by its side
    terrain_random {position_m, low_m, range_m, seed, terrains}   (spr)
    sds_uncorrelated | covariance_known {cameras}       (if expected_px is given)
"""

import math
from dataclasses import fields, make_dataclass
from typing import Literal

import numpy as np

from tankcal.calibration.influence.blocks import InteriorValue
from tankcal.calibration.interiors import Shift
from tankcal.calibration.parameters.recommendation import Advice
from tankcal.calibration.product import ADVISED, AxisCheck, Precision, Reached
from tankcal.camera.model import KEYS, PARAMETERS, UNITS
from tankcal.record.schema import Saved, fill_from, key, to_plain
from tankcal.record.versions import CameraFile
from tankcal.units import ARCSEC_PER_RAD

MM = 1e3


class ImageAccuracy(Saved):
    """Image accuracy with which effects are compared."""

    um: float = key("micrometres")
    px: float = key("pixels")
    source: str = key('"given" or "residuals"', named="from")


class EdgeShifts(Saved):
    """Shifts over the frame: largest and rms; seen: largest within reach of the image points."""

    own: Shift | None = key("of the value itself (null for c)")
    left: Shift | None = key("predicted remainder after compensation by other parameters")
    left_turned: Shift | None = key("predicted remainder after compensation also by a rotation")


class ParameterJudged(Saved):
    """A parameter of the model; F to significant are null for a fixed one, whose sd is 0."""

    name: str = key("of the parameter")
    unit: str = key("of value and sd")
    value: float = key("as adjusted")
    sd: float = key("0: fixed")
    F: float | None = key("test quantity against 0")
    critical: float | None = key("its critical value")
    p_value: float | None = key("probability of an F as large by chance")
    significant: bool | None = key("whether F is above the critical value")
    decides: bool = key("false for c, for which the test against 0 is not relevant")
    state: str = key('"free", "weighted" or "fixed"')
    scope: str = key('"off", "block", "camera" or "photo"')
    edge_um: float | None = key("shift of the worst corner of the frame by the value")
    edge_px: float | None = key("shift of this corner in pixels")
    edge: EdgeShifts = key("over the frame")


class GroupTest(Saved):
    """Joint test of several parameters against zero."""

    names: list[str] = key("of the parameters")
    F: float | None = key("test quantity", of="f")
    critical: float | None = key("its critical value")
    p_value: float | None = key("probability of an F as large by chance")
    significant: bool | None = key("whether F is above the critical value")
    positive_definite: bool = key("false: no test is possible")


class PrincipalComponents(Saved):
    """Principal components of the parameters, the largest first."""

    of: str = key('"correlation" or "covariance"')
    names: list[str] = key("of the parameters")
    positive_definite: bool = key("of the matrix")
    smallest_eigenvalue: float = key("of the matrix")
    eigenvalues: list[float] = key("descending")
    share_percent: list[float] = key("of their sum")
    cumulative_percent: list[float] = key("of their sum")
    vectors: list[list[float]] = key("parameter x component")
    loadings: list[list[float]] = key("parameter x component")
    values: list[float] = key("of the components")
    values_of: str = key('"standardised" parameters or their "values"')


class PointsMoved(Saved):
    """Changes of the adjusted points."""

    count: int = key("points compared")
    rms_mm: float = key("of the distance", of="rms_m", times=MM)
    largest_mm: float = key("distance", of="largest_m", times=MM)
    largest_point: str = key("with the largest change")
    axis_rms_mm: list[float] = key("x, y, z", of="axis_rms_m", times=MM)
    axis_largest_mm: list[float] = key("x, y, z", of="axis_largest_m", times=MM)
    rms_sds: float = key("of each coordinate's change over its own sd")
    largest_sds: float = key("largest of these")
    largest_sds_point: str = key("its point")


class TopOfTable(Saved):
    """The volume at the top of the table; null: no tank, or no capacity."""

    volume_m3: float | None = key("at the top", of="value_m3")
    volume_u_m3: float | None = key("standard uncertainty", of="u_m3")
    volume_U_m3: float | None = key("expanded uncertainty", of="U_m3")
    height_m: float | None = key("dip of the top")
    wall_points: int | None = key("of the wall", of="points")


class TrialWithout(Saved):
    """The survey without some parameters; null from sigma0 on if it was not adjusted again."""

    names: list[str] = key("of the dropped parameters")
    because: list[str] = key('"single", "group", "silva", "pessoa", "advised" (all removable)')
    comparable: bool = key("false if other sets changed too, unlike in the prediction")
    kept: list[str] = key("names, in the order of the following lists")
    positive_definite: bool = key("false: the dropped parameters are not separable")
    values_predicted: list[float] = key("of the kept parameters")
    sds_predicted: list[float] = key("of the kept parameters")
    correlation_predicted: list[list[float]] = key("of the kept parameters")
    failed: str | None = key("reason of a failed adjustment, or (with points) of a missing volume")
    sigma0: float | None = key("of the adjustment")
    values_adjusted: list[float] | None = key("of the kept parameters")
    sds_adjusted: list[float] | None = key("for the sigma0 of the survey with all parameters")
    correlation_adjusted: list[list[float]] | None = key("of the kept parameters")
    points: PointsMoved | None = key("against the survey with all parameters")
    volume_change_m3: float | None = key("at the top of the table")


class TrialWithVolume(TopOfTable, TrialWithout):
    """A trial, and the volume at the top of the table without these parameters."""


class WhyNoVolume(Saved):
    """The first key of the survey with all parameters."""

    no_volume: str | None = key("reason of a missing volume")


class WithAll(TopOfTable, WhyNoVolume):
    """The volume at the top of the table with all parameters."""


class Loading(Saved):
    """Loading of a parameter on a component."""

    name: str = key("of the parameter")
    loading: float = key("on the component")


class HighComponent(Saved):
    """A component with high loadings of two or more parameters."""

    component: int = key("number, from 1")
    share_percent: float = key("of the eigenvalues")
    high: list[Loading] = key("high loadings")


class SilvasRule(Saved):
    """Result of Silva's rule."""

    may_go: int = key("number of components with a negligible share")
    negligible_percent: float = key("limit of the share")
    loading: float = key("limit of the loading")
    alike: float = key("limit of likeness")
    drop: list[str] = key("names, in the order of removal")
    components: list[HighComponent] = key("with two or more high loadings")


class KeptBecause(Saved):
    """A parameter that Pessoa's rule keeps."""

    name: str = key("of the parameter")
    because: str = key('"significant", "edge", "both" or "not_known"')


class PessoasRule(Saved):
    """Result of Pessoa's rule."""

    limit_px: float | None = key("limit of the shift of a corner; null: limit_um is used")
    limit_um: float | None = key("limit of the shift of a corner; null: limit_px is used")
    drop: list[str] = key("names")
    keep: list[KeptBecause] = key("all other parameters")


class PublishedRules(Saved):
    """Results of published rules."""

    silva: SilvasRule = key("Silva 1995")
    pessoa: PessoasRule = key("Pessoa")


class ParametersFile(CameraFile, kw_only=True):
    """Significance of the parameters of a set."""

    kind: Literal["parameters"] = key("parameters", default="parameters")
    camera: str = key("name", of="interior.camera")
    photos: list[str] | None = key("when the set is not the whole camera's", of="interior.photos")
    source: str = key('"job" or "record"', named="from")
    convention: str = key("sign of the distortion's terms", of="interior.form.convention")
    affinity: str = key("form of the affinity terms", of="interior.form.affinity")
    radial_balance_mm: float = key("of the model", of="interior.form.radial_balance_mm")
    format_mm: list[float] | None = key("width and height", of="interior.format_mm")
    pixel_mm: list[float] | None = key("sides of a pixel", of="interior.frame.pixel_mm")
    half_frame_mm: list[float] = key("half width and height", of="interior.frame.half_mm")
    frame_known: bool = key("declared, not estimated from image points", of="interior.frame_known")
    reach_mm: float = key("of the farthest image point", of="interior.frame.reach_mm")
    corner_mm: float = key("of the corners from the middle", of="interior.frame.corner_mm")
    dof: float = key("of the adjustment; null: sigma0 was not estimated")
    sigma0: float = key("of the adjustment")
    scale: str = key('"a_posteriori" (sds contain sigma0, F test) or "a_priori" (chi-square)')
    alpha: float = key("level of the tests", of="choices.alpha")
    image_accuracy: ImageAccuracy | None = key("null: it is not known")
    parameters: list[ParameterJudged] = key("of the model")
    names: list[str] = key("of adjusted parameters: rows and columns of `correlation`")
    correlation: list[list[float]] = key("of the adjusted parameters")
    groups: list[GroupTest] = key("joint tests of several parameters")
    components: PrincipalComponents = key("of the parameters")
    without: list[TrialWithVolume] = key("sets of removable parameters")
    with_all: WithAll | None = key("null: of a record, not adjusted again")
    rules: PublishedRules = key("results of published rules")
    recommendation: list[Advice] = key("reasons: {code, ...}")


def plain_parameters(result):
    """Return the `ParametersFile` of a `judgement.CameraParameters`, as plain data."""
    limit, parts = result.limit, result.components
    known = not math.isnan(limit.um) or not math.isnan(limit.px)
    unscaled = parts.unscaled or parts.of == "covariance"
    components = [
        HighComponent(number + 1, share, [Loading(*loading) for loading in high])
        for number, share, high in result.silva.high
    ]
    file = fill_from(
        ParametersFile,
        result,
        image_accuracy=fill_from(ImageAccuracy, limit) if known else None,
        parameters=[_parameter(result, name) for name in result.own],
        groups=[fill_from(GroupTest, test) for test in result.groups],
        components=fill_from(
            PrincipalComponents, parts, values_of="values" if unscaled else "standardised"
        ),
        without=[_trial(result, trial) for trial in result.trials],
        with_all=result.base and WithAll(result.base[1], *_volume(result.base[0])),
        rules=PublishedRules(
            fill_from(SilvasRule, result.silva, components=components),
            fill_from(
                PessoasRule, result.pessoa, keep=[KeptBecause(*kept) for kept in result.pessoa.keep]
            ),
        ),
    )
    return to_plain(file)


def _parameter(result, name):
    interior, number = result.interior, PARAMETERS.index(name)
    adjusted = name in result.names
    test = result.tests[result.names.index(name)] if adjusted else None
    shift, remainders = result.own[name], result.left.get(name) or (None, None)
    return ParameterJudged(
        name=name,
        unit=UNITS[name],
        value=interior.values[number],
        sd=result.sds[result.names.index(name)] if adjusted else 0.0,
        F=test and test.f,
        critical=test and test.critical,
        p_value=test and test.p_value,
        significant=test and test.significant,
        decides=test is None or test.decides,
        state=interior.state[number],
        scope=interior.scope[number],
        edge_um=shift and shift.corner_um,
        edge_px=shift and shift.corner_px,
        edge=EdgeShifts(shift, *remainders),
    )


def _trial(result, trial):
    predicted, outcome = trial.predicted, trial.outcome
    values, sds, correlation = _adjusted_values(trial)
    volume = None if outcome is None else outcome.volume
    base = None if result.base is None else result.base[0]
    return TrialWithVolume(
        trial.names,
        trial.because,
        trial.comparable,
        predicted.kept,
        predicted.positive_definite,
        predicted.values,
        predicted.sds,
        predicted.correlation,
        outcome and outcome.failed,
        outcome.adjustment.sigma0 if outcome and outcome.adjustment else None,
        values,
        sds,
        correlation,
        outcome and fill_from(PointsMoved, outcome.changes),
        volume.value_m3 - base.value_m3 if volume and base else None,
        *_volume(volume),
    )


def _adjusted_values(trial):
    """Return values, sds and correlations of kept parameters; three times None if not adjusted."""
    if trial.after is None:
        return None, None, None
    names, values, covariance = trial.after
    order = [names.index(name) for name in trial.predicted.kept]
    covariance = covariance[np.ix_(order, order)]
    sds = np.sqrt(np.diag(covariance))
    return values[order], sds, covariance / np.outer(sds, sds)


def _volume(volume):
    """Return the values of `TopOfTable`; each is None without volume."""
    top = fill_from(TopOfTable, volume)
    return [None] * len(fields(TopOfTable)) if top is None else vars(top).values()


DECIMALS = 4  # of a difference in pixels
Interior = make_dataclass(
    "Interior",
    [
        (name, float, key(f"value or sd of {name}", named=key_in_file))
        for name, key_in_file in KEYS.items()
    ],
    namespace={"__doc__": "Parameters of the camera, each with its unit; of sds null: not known."},
    frozen=True,
)
UM = 1e3


# ---- comparison of calibrations: kind "stability" of camera.json


class ComparisonGrid(Saved):
    """Grid of compared image points."""

    columns: int = key("number")
    rows: int = key("number")
    start_px: list[float] = key("x, y of the first")
    step_px: float = key("between neighbours")


class ComparisonTerrain(Saved):
    """Object points by which the bundles are aligned."""

    position_m: list[float] = key("x, y, z of the projection centre")
    low_m: float = key("lowest height")
    range_m: float = key("of the heights")
    seed: int = key("of the heights")
    terrains: int = key("drawn", of="drawn")


class NameOfCamera(Saved):
    """The first key of a camera."""

    name: str = key("as in the file")


class ComparedCamera(Interior, NameOfCamera):
    """A calibration, as it was read."""

    sd: Interior = key("sds")
    convention: str = key("sign of the distortion's terms", of="form.convention")
    affinity: str = key("form of the affinity terms", of="form.affinity")
    radial_balance_mm: float = key("radius at which distortion is 0", of="form.radial_balance_mm")
    format_px: list[float] = key("columns, lines")
    pixel_um: list[float] = key("sides, x and y")


class ComparedPair(Saved):
    """Two calibrations: second set minus first."""

    a: str = key("name of the first, which is before b in the file")
    b: str = key("name of the second")
    method: str = key("of the comparison")
    figure_px: float = key("of spr pooled over the terrains")
    scatter_px: float | None = key("its sd from terrain to terrain (spr)")
    similar: bool = key("whether the figure is below the threshold")
    largest_px: float = key("length of a difference")
    mean_px: float = key("of the lengths")
    rmse_px: float = key("of the lengths")
    expected_px: float | None = key("figure expected from the declared sds alone")
    scale: float | None = key("of the second set (zrot)")
    rotation_deg: list[float] | None = key("omega, phi, kappa of the second bundle (rot, spr)")
    shift_m: list[float] | None = key("of the second projection centre (spr)")
    difference_px: list[list[float]] = key("rows x columns: lengths, to 1e-4 px")
    difference_x_px: list[list[float]] = key("rows x columns")
    difference_y_px: list[list[float]] = key("rows x columns, y up")


class StabilityFile(CameraFile, kw_only=True):
    """A comparison of calibrations."""

    kind: Literal["stability"] = key("stability", default="stability")
    method: str = key('"mis", "zrot", "rot" or "spr"')
    as_published: bool = key("whether Pessoa's conventions are followed")
    conventions: list[dict] = key("{code, ...}: choices on which a figure depends")
    grid: ComparisonGrid = key("image points")
    threshold_px: float = key("similar when the figure is below it")
    terrain: ComparisonTerrain | None = key("null but for spr")
    cameras: list[ComparedCamera] = key("as read")
    pairs: list[ComparedPair] = key("(2, 1), (3, 1), (3, 2), (4, 1) ...")


def plain_stability(result):
    """Return the `StabilityFile` of a Stability, as plain data."""
    file = fill_from(
        StabilityFile,
        result,
        conventions=[{"code": choice.code, **choice.values} for choice in result.conventions],
        grid=fill_from(ComparisonGrid, result.grid),
        terrain=result.terrain and fill_from(ComparisonTerrain, result.terrain, seed=result.seed),
        cameras=[_camera(setup, result.format_px) for setup in result.setups],
        pairs=[_pair(pair, result) for pair in result.pairs],
    )
    return to_plain(file)


def summary(result):
    """Return the pairs, [{a, b, method, figure_px, scatter_px, similar}], a first in the file."""
    return [
        {
            "a": pair.a,
            "b": pair.b,
            "method": result.method,
            "figure_px": pair.figure_px,
            "scatter_px": pair.scatter_px,
            "similar": pair.similar,
        }
        for pair in result.pairs
    ]


def _camera(setup, format_px):
    camera = setup.camera
    return fill_from(
        ComparedCamera,
        camera,
        **dict(zip(PARAMETERS, np.asarray(camera.values, dtype=float).tolist(), strict=True)),
        sd=Interior(*camera.sd),
        format_px=format_px,
        pixel_um=1000 * np.asarray(setup.pixel_mm),
    )


def _pair(pair, result):
    length = np.hypot(*pair.difference_px.T)
    along, up = (_round_to_grid(part, result.grid) for part in pair.difference_px.T)
    return fill_from(
        ComparedPair,
        pair,
        method=result.method,
        largest_px=float(length.max()),
        mean_px=float(length.mean()),
        rmse_px=float(np.sqrt(np.mean(length**2))),
        rotation_deg=None if pair.rotation_rad is None else np.degrees(pair.rotation_rad),
        difference_px=_round_to_grid(length, result.grid),
        difference_x_px=along,
        difference_y_px=up,
    )


def _round_to_grid(values, grid):
    """Return values of the grid points, stored row by row, as [rows][columns]."""
    return np.round(values, DECIMALS).reshape(grid.rows, grid.columns)


# ---- check of a product at check points: kind "product" of camera.json


class PartJudged(Saved):
    """Differences of a part."""

    part: str = key('"plan" (x and y together) or "height"')
    n: int = key("points")
    rmse_m: float = key("of the differences")
    rmse_unbiased_m: float = key("of the differences less their significant means")
    largest_m: float = key("largest magnitude")


class ProductNote(Saved):
    """A note: few_points, no_tests, share_means_all, axis_without_points, ..."""

    code: str = key("fewer points than `advised`; than 2; than 10 (90 % are all points); ...")
    n: float = key("points, or the number of the axis")


class LimitsUsed(Saved):
    """The limit table."""

    name: str = key("of the table")
    source: str = key("of its limits")
    share: float = key("of the points that must lie within the tolerance, 0 to 1")
    verified: bool | None = key("whether they were read in the text itself; null: unknown")
    remark: str = key("to be printed with the table")
    code: str | None = key("of a shipped table")


class ClassJudged(Saved):
    """A class of a scale: reached with `share` of the points within tolerance_m, rmse_m in sd_m."""

    part: str = key('"plan" or "height"')
    scale: str = key('text, such as "1000"')
    grade: str = key("name of the class")
    tolerance_m: float = key("that a share of the points must meet")
    sd_m: float = key("bound of the RMSE")
    n: int = key("points")
    as_is: Reached = key("by the differences")
    unbiased: Reached = key("by the differences less their significant means")
    precision: list[Precision] = key("of each axis")
    precise: bool | None = key("whether all axes passed; null: not determined")


class BestClass(Saved):
    """The best class of a scale; null: no class is reached."""

    part: str = key('"plan" or "height"')
    scale: str = key('text, such as "1000"')
    grade: str | None = key("by the differences")
    grade_unbiased: str | None = key("by the differences less their significant means")


class Difference(Saved):
    """Product minus truth at a point; only existing axes; null: not known."""

    point: str = key("name")
    dx_m: float | None = key("along x", optional=True)
    dy_m: float | None = key("along y", optional=True)
    dz_m: float | None = key("along z", optional=True)


class ProductFile(CameraFile, kw_only=True):
    """Accuracy of a product from differences at check points."""

    kind: Literal["product"] = key("product", default="product")
    alpha: float = key("level of the tests of bias (two-sided) and of precision (upper)")
    n: int = key("points")
    axes: list[AxisCheck] = key("each axis")
    parts: list[PartJudged] = key("plan and height if known")
    notes: list[ProductNote] = key("on the check")
    advised: int = key("number of points advised for a test of accuracy")
    table: LimitsUsed | None = key("null: no limits were requested")
    verdicts: list[ClassJudged] = key("each class")
    best: list[BestClass] = key("each scale")
    differences: list[Difference] = key("each point")


def product_of(check):
    """Return the `ProductFile` of a ProductCheck."""
    scales = dict.fromkeys((verdict.part, verdict.scale) for verdict in check.verdicts)
    return fill_from(
        ProductFile,
        check,
        n=len(check.names),
        axes=check.checks,
        parts=[fill_from(PartJudged, part, largest_m=part.size_m.max()) for part in check.parts],
        notes=[ProductNote(*note) for note in check.notes],
        advised=ADVISED,
        table=fill_from(LimitsUsed, check.table),
        verdicts=[fill_from(ClassJudged, verdict) for verdict in check.verdicts],
        best=[
            BestClass(part, scale, check.best(part, scale), check.best(part, scale, unbiased=True))
            for part, scale in scales
        ],
        differences=[
            {"point": name}
            | {f"d{axis}_m": value for axis, value in zip(check.axes, row, strict=True)}
            for name, row in zip(check.names, check.difference_m, strict=True)
        ],
    )


def plain_product(check):
    """Return the `ProductFile` of a ProductCheck, as plain data."""
    return to_plain(product_of(check))


# ---- influence of calibrations on a block: kind "influence" of camera.json


class ReadingSetAside(Saved):
    """A reading that was rejected in the reference, and is excluded from all runs."""

    kind: str = key("of observation")
    ids: list[str] = key("names")
    element: str = key('"x", "omega", ...')
    file: str = key("of the reading")
    row: int | None = key("of the file")
    w: float = key("test quantity")


class BlunderSearch(Saved):
    """The search in the reference; all runs use the readings of the reference."""

    searched: bool = key("whether blunders were searched for")
    removed: list[ReadingSetAside] = key("rejected readings")


class Skipped(Saved):
    """Reason for skipping a run."""

    code: str = key('"no_sds": a calibration without sds cannot be weighted')


class RunQuality(Saved):
    """Global test of a run; null: no redundancy."""

    sigma0: float | None = key("a posteriori")
    chi2: float = key("v'Pv", of="test.chi2")
    chi2_low: float | None = key("two-sided bound")
    chi2_high: float | None = key("two-sided bound")
    passed: bool | None = key("whether chi2 lies between them")
    redundancy: int = key("of the run")
    confidence: float = key("of the bounds", of="test.confidence")


class RunImages(Saved):
    """Residuals of the camera's photos."""

    n: int = key("images")
    rms_um: list[float] = key("x, y", of="rms_mm", times=UM)
    largest_um: float = key("of a single coordinate", of="largest_mm", times=UM)
    largest_photo: str = key("its photo")
    largest_point: str = key("its point")
    rms_px: list[float] | None = key("x, y")
    largest_px: float | None = key("of a single coordinate")


class RunVolume(Saved):
    """Volume of the tank at the top of its table."""

    volume_m3: float = key("at the top", of="value_m3")
    u_m3: float = key("standard uncertainty")
    U_m3: float = key("expanded uncertainty")
    k: float = key("coverage factor")
    height_m: float = key("dip of the top")
    points: int | None = key("of the wall; null: not surveyed")


class PointShifts(Saved):
    """Differences of the points; null: no points."""

    n: int = key("points")
    rms_mm: list[float] = key("along x, y, z", of="rms_m", times=MM)
    largest_mm: list[float] = key("along x, y, z", of="largest_m", times=MM)
    rms_xyz_mm: float = key("of the magnitudes", of="rms_xyz_m", times=MM)
    largest_xyz_mm: float = key("magnitude", of="largest_xyz_m", times=MM)
    largest_point: str | None = key("with the largest difference", of="largest_name")


class PhotoShifts(Saved):
    """Differences in position of the photos, and rotations about the axes of the image."""

    n: int = key("photos")
    rms_mm: list[float] = key("along x, y, z", of="rms_m", times=MM)
    rms_xyz_mm: float = key("of the magnitudes", of="rms_xyz_m", times=MM)
    largest_xyz_mm: float = key("magnitude", of="largest_xyz_m", times=MM)
    largest_photo: str | None = key("with the largest difference", of="largest_name")
    rms_arcsec: list[float] = key("about x, y, z", of="rms_rad", times=ARCSEC_PER_RAD)
    rms_turn_arcsec: float = key("of the total rotations", of="rms_turn_rad", times=ARCSEC_PER_RAD)
    largest_turn_arcsec: float = key("total rotation", of="largest_turn_rad", times=ARCSEC_PER_RAD)
    largest_turn_photo: str | None = key("with the largest rotation", of="largest_turn_name")


class VolumeShift(Saved):
    """Difference of the capacities at the top."""

    difference_m3: float = key("other minus one", of="volume_m3")
    percent: float = key("of the volume of one", of="volume_percent")


class Shifts(Saved):
    """Differences between two runs."""

    points: PointShifts = key("of the points")
    photos: PhotoShifts = key("of the photos")
    aligned: int = key("unobserved degrees of freedom, removed from the differences (0 to 7)")
    volume: VolumeShift | None = key("of the tank")


class RunNumbers(Saved):
    """Two runs, by their numbers in `runs`."""

    one: int = key("the reference is 0")
    other: int = key("compared with one")


class PairOfRuns(Shifts, RunNumbers):
    """Two adjusted runs: other minus one. Pairs with the reference come first."""


class AdjustedRun(Saved):
    """An adjustment of the block; results of a run that was not adjusted are null."""

    label: str = key('"reference", or "NAME, fixed"')
    calibration: str | None = key("NAME; null for the reference")
    state: str | None = key('"fixed", "weighted" or "free"; null for the reference')
    outcome: str = key('"adjusted", "failed" or "skipped"')
    message: str | None = key("reason of the failure, in words")
    skipped: Skipped | None = key("reason for skipping it")
    held: list[str] = key("parameters held at a value other than 0, for lack of an sd")
    quality: RunQuality | None = key("global test")
    images: RunImages | None = key("residuals of the camera's photos")
    convention: str | None = key("sign of the distortion's terms")
    affinity: str | None = key("form of the affinity terms")
    interior: list[InteriorValue] | None = key("parameters; sd 0: held; start_sd null: not given")
    product: ProductFile | None = key("check points")
    volume: RunVolume | None = key("at the top of the table")
    volume_failed: str | None = key("reason of a missing volume, for a job with a tank")
    shifts: Shifts | None = key("against the reference; null for the reference")


class InfluenceFile(CameraFile, kw_only=True):
    """Influence of calibrations on a block."""

    kind: Literal["influence"] = key("influence", default="influence")
    camera: str = key("of the job, whose calibration was replaced")
    states: list[str] = key("requested states")
    calibrations: list[str] = key("names, in their order")
    photos: int = key("in the reference")
    points: int = key("in the reference")
    search: BlunderSearch = key("for blunders, in the reference")
    free: list[str] = key('parameters adjusted in the runs "free"')
    runs: list[AdjustedRun] = key("the reference, with the settings of the job, first")
    pairs: list[PairOfRuns] = key("all adjusted runs, in the order of `runs`")


def plain_influence(influence):
    """Return the `InfluenceFile` of an Influence, as plain data."""
    block = influence.runs[0].block
    return to_plain(
        fill_from(
            InfluenceFile,
            influence,
            photos=len(block.photos) if block else 0,
            points=len(block.points) if block else 0,
            search=BlunderSearch(
                influence.searched,
                [fill_from(ReadingSetAside, reading) for reading in influence.removed],
            ),
            runs=[_run(number, run, influence) for number, run in enumerate(influence.runs)],
            pairs=[
                _shifts(PairOfRuns, pair, one=pair.one, other=pair.other)
                for pair in influence.pairs
            ],
        )
    )


def _run(number, run, influence):
    against_reference = next(
        (pair for pair in influence.pairs if (pair.one, pair.other) == (0, number)), None
    )
    block = run.block
    return fill_from(
        AdjustedRun,
        run,
        skipped=Skipped(run.skipped) if run.skipped else None,
        quality=_quality(block),
        images=block and fill_from(RunImages, block.images),
        convention=block and block.form.convention,
        affinity=block and block.form.affinity,
        interior=block and block.interior,
        product=product_of(block.check) if block and block.check else None,
        volume=fill_from(RunVolume, run.volume),
        shifts=_shifts(Shifts, against_reference) if against_reference else None,
    )


def _quality(block):
    if block is None:
        return None
    test = block.test
    return fill_from(
        RunQuality,
        block,
        chi2_low=test.low if test.dof else None,
        chi2_high=test.high if test.dof else None,
        passed=bool(test.passed) if test.dof else None,
        redundancy=int(test.dof),
    )


def _shifts(cls, pair, **numbers):
    return cls(
        points=fill_from(PointShifts, pair.points),
        photos=fill_from(PhotoShifts, pair.photos),
        aligned=pair.aligned,
        volume=None if pair.volume_m3 is None else fill_from(VolumeShift, pair),
        **numbers,
    )
