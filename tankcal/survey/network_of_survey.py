"""Photographs of a survey: those adjusted, and the prior information on their orientation.

Conversion of measurements to a network survey: names become numbers, repeated readings means.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tankcal.errors import InputError, Problem
from tankcal.geometry.rotations import rotation_of_angles
from tankcal.messages import join_with_and, list_some, message
from tankcal.survey.diagnosis.diagnoses import image_point_label
from tankcal.survey.network import Instrument, Photos, Survey, System
from tankcal.survey.network.assembly import one_ray_sentence
from tankcal.survey.observations import (
    KINDS,
    Block,
    ControlCoordinates,
    ImageCoordinates,
    PhotoOrientation,
    PhotoRotation,
    Source,
    SystemCoordinates,
)
from tankcal.survey.readings import (
    Numbers,
    average_repeated,
    bend_per_m,
    observations_of_readings,
    reject_scattered,
)

ELEMENTS = ("x", "y", "z", "omega", "phi", "kappa")
TURNS = ("about x", "about y", "about z")  # rotations of the image relative to the given rotation
FEWEST = 3  # image points required in a photo


def gathered_photos(measurements):
    """Collect the photos with image points.

    Returns
    -------
    photos : network.Photos or None
        Unknown values are nan; None without photographs.
    cameras : tuple of network.Camera
    order : dict
        {name: number} of the photos.

    Raises
    ------
    InputError
        If photos have too few image points.
    """
    images = measurements.image_points
    if images is None or not len(images.photo):
        return None, (), {}
    points_of_photo = {}
    for photo, point, check in zip(images.photo, images.point, images.check, strict=True):
        if not check:
            points_of_photo.setdefault(photo, set()).add(point)
    photos = [item for item in measurements.photos if item.name in points_of_photo]
    _refuse_poor(photos, points_of_photo)
    # Number the cameras in the order of their first photo; unused cameras are left out.
    cameras = {}
    for item in photos:
        cameras.setdefault(item.camera, len(cameras))
    settings = {item.camera.name: item.camera for item in measurements.cameras}
    values = np.array([item.values for item in photos], dtype=float)
    fixed = np.array([item.sd for item in photos]) == 0
    result = Photos(
        names=tuple(item.name for item in photos),
        camera=np.array([cameras[item.camera] for item in photos], dtype=int),
        xyz_m=values[:, :3],
        rotation=rotation_of_angles(*values[:, 3:].T),
        fixed=np.column_stack([fixed[:, :3], fixed[:, 3:].all(axis=1)]),
    )
    order = {item.name: number for number, item in enumerate(photos)}
    return result, tuple(settings[name] for name in cameras), order


def _refuse_poor(photos, points_of_photo):
    """Raise InputError listing all photos with too few image points."""
    poor = [
        Problem(
            "photos.csv",
            message(
                "photo_hardly_seen",
                "photo {name} has {count} image points; at least {fewest} are needed, or all six "
                "elements of its orientation with standard deviations",
                name=photo.name,
                count=len(points_of_photo[photo.name]),
                fewest=FEWEST,
            ),
            photo.row,
        )
        for photo in photos
        if len(points_of_photo[photo.name]) < FEWEST and not np.isfinite(photo.sd).all()
    ]
    if poor:
        raise InputError(poor)


def orientation_of(measurements, order):
    """Return observations of the elements of orientation known a priori.

    Fixed coordinates and fixed rotations are not unknowns, so they are not observed.

    Parameters
    ----------
    measurements : Measurements
    order : dict
        {name: number} of the adjusted photos.

    Returns
    -------
    list of Observations
    """
    photos = [photo for photo in measurements.photos if photo.name in order]
    single, whole = [], []
    for photo in photos:
        sd = np.asarray(photo.sd, dtype=float)
        rotation = np.isfinite(sd[3:]) & (sd[3:] > 0)
        for element in np.flatnonzero(np.isfinite(sd) & (sd > 0)):
            # A rotation with three standard deviations is observed as a whole, below.
            if element < 3 or not rotation.all():
                single.append((photo, int(element)))
        # A rotation is fixed only as a whole. Single fixed angles enter as observations with sd 0.
        if not rotation.all() and not (sd[3:] == 0).all():
            single += [(photo, int(3 + element)) for element in np.flatnonzero(sd[3:] == 0)]
        if rotation.all():
            whole.append(photo)
    observations = [_single(single, order)] if single else []
    return [*observations, _whole(whole, order)] if whole else observations


def _single(single, order):
    """PhotoOrientation of single elements."""
    value = np.array([photo_of_row.values[element] for photo_of_row, element in single])
    sd = np.array([photo_of_row.sd[element] for photo_of_row, element in single])
    photo = np.array([order[photo_of_row.name] for photo_of_row, _ in single])
    element = np.array([element for _, element in single])
    trace = _trace([photo_of_row for photo_of_row, _ in single], [(ELEMENTS[e],) for e in element])
    return PhotoOrientation(value, sd, photo, element, trace=trace)


def _whole(photos, order):
    """PhotoRotation of photos whose three angles have standard deviations."""
    angles = np.array([item.values[3:] for item in photos], dtype=float)
    sd = np.array([item.sd[3:] for item in photos], dtype=float)
    photo = np.array([order[item.name] for item in photos])
    trace = _trace(photos, [TURNS] * len(photos))
    known = rotation_of_angles(*angles.T)
    # The observed small rotation relative to the given rotation is zero.
    return PhotoRotation(np.zeros((len(photos), 3)), sd, photo, known, trace=trace)


def _trace(photos, elements):
    names = tuple((photo.name,) for photo in photos)
    return Source(
        "photos.csv", tuple(photo.row for photo in photos), names, tuple(elements)
    ).trace()


AXES = "xyz"
TOLD = 10  # warnings listed singly; further omitted points are only counted
# smallest eigenvalue accepted of a correlation matrix; below it the values contradict
SMALLEST = 1e-10


@dataclass(frozen=True)
class GatheredSurvey:
    """A survey without start values, whose observations keep a Trace to their readings.

    Attributes
    ----------
    survey : network.Survey
        Unknown coordinates are nan. Control is observed or fixed with datum "control" only.
    checks : tuple of Observations
        Compared, not adjusted.
    known : KnownControl
        Control in the frame of the survey.
    idle : ndarray of bool, shape (points, 3)
        True: no observation determines this coordinate; it keeps its start value.
    lost : dict
        {name: file} of points that cannot be adjusted.
    aside : tuple
        Sentences about the lost points.
    warnings : tuple of Problem
    repeats : RepeatedReadings or None
        Repeated readings of image points.
    """

    survey: Survey
    checks: tuple
    known: object
    idle: np.ndarray
    lost: dict
    aside: tuple
    warnings: tuple
    repeats: object = None


@dataclass(frozen=True)
class KnownControl:
    """Control coordinates and their standard deviations in the frame of the survey; nan: none.

    Attributes
    ----------
    xyz_m, sd_m : ndarray, shape (points, 3)
    row : dict
        {point: row of control.csv}.
    """

    xyz_m: np.ndarray
    sd_m: np.ndarray
    row: dict


def gather(measurements):
    """Convert Measurements to a GatheredSurvey.

    Raises
    ------
    InputError
        If measurements contradict each other or lack standard deviations.
    """
    measurements, repeated, scattered = reject_scattered(measurements)
    excluded = {}
    # Omitting a point removes observations of its neighbours, so repeat until every point has
    # enough.
    while True:
        gathered = _gather(measurements, excluded)
        poor = find_left_out(gathered.survey)
        if not poor:
            break
        excluded |= poor
    excluded = _omitted_points(measurements, gathered.survey.points, excluded)
    where = {name: find_point_row(measurements, name) for name in excluded}
    idle, warnings = find_untouched_coordinates(gathered.survey)
    warnings += _omission_warnings(excluded, where)
    # A coordinate without observation would make the normal matrix singular.
    fixed = idle if gathered.survey.fixed is None else gathered.survey.fixed | idle
    return replace(
        gathered,
        survey=replace(gathered.survey, fixed=fixed),
        idle=idle,
        lost={name: file for name, (file, _) in where.items()},
        aside=tuple(excluded.values()),
        warnings=(*scattered, *gathered.warnings, *warnings),
        repeats=repeated,
    )


def _omission_warnings(excluded, where):
    """Problem rows of omitted points {name: reason}: the first ones, and the number of the
    others."""
    problems = [Problem(where[name][0], text, where[name][1]) for name, text in excluded.items()]
    if len(problems) <= TOLD:
        return problems
    text = message(
        "more_left_out",
        "further points are left out because they have too few observations: {points}",
        points=list_some(list(excluded)[TOLD - 1 :], TOLD),
    )
    return [*problems[: TOLD - 1], Problem("job.toml", text, None, "adjustment")]


def _omitted_points(measurements, points, excluded):
    """{name: reason} of omitted points, including unmeasured points of control.csv and
    check.csv."""
    reasons = dict(excluded)
    for table in (measurements.control, measurements.check):
        for name in () if table is None else table.point:
            if name not in points and name not in reasons:
                reasons[name] = unmeasured_sentence(name)
    return reasons


def find_point_row(measurements, name):
    """File and row of the first occurrence of a point."""
    tables = [(measurements.image_points, ("point",)), (measurements.control, ("point",))]
    tables += [
        (table_of_readings, ("end", "start", "origin"))
        for table_of_readings in measurements.readings
    ]
    for table, columns in [*tables, (measurements.check, ("point",))]:
        for column in columns if table is not None else ():
            names = getattr(table, column)
            if name in names:
                return table.file, table.rows[names.index(name)] if table.rows else None
    return "setups.csv", None


def _gather(measurements, excluded):
    """The GatheredSurvey of measurements without the excluded points."""
    warnings = []
    numbers = _numbers(measurements, excluded)
    known = _known_control(measurements.control, numbers.points)
    observations, checks = [], []
    fixed = None
    if measurements.settings.datum == "control":
        fixed = np.nan_to_num(known.sd_m, nan=1.0) == 0
        # With another datum, control serves for start values and comparison only.
        fixed &= np.isfinite(known.xyz_m)
        alone = rows_of(measurements.correlated, "control")
        observations += _control(measurements.control, numbers.points, warnings, alone)
    systems, of_systems = _systems(measurements.control, numbers.points)
    observations += of_systems
    bend = bend_per_m(measurements.settings.refraction)
    for readings in measurements.readings:
        alone = rows_of(measurements.correlated, readings.table)
        adjusted, compared = observations_of_readings(
            readings, numbers, bend=bend, warnings=warnings, correlated=alone
        )
        observations += adjusted
        checks += compared
    photos, cameras, order = gathered_photos(measurements)
    images = None
    if photos is not None:
        images, compared = _images(measurements, numbers.points, order, warnings)
        checks += compared
        observations += orientation_of(measurements, order)
    survey = Survey(
        points=tuple(numbers.points), xyz_m=np.full((len(numbers.points), 3), np.nan),
        fixed=fixed, image_points=images, photos=photos, cameras=cameras,
        observations=tuple(observations), sets=np.full(len(numbers.sets), np.nan),
        instruments=_instruments(measurements, numbers), systems=systems,
        correlated=blocks_of(measurements, observations), set_names=tuple(numbers.sets),
        kept=measurements.kept,
    )  # fmt: skip
    return GatheredSurvey(survey, tuple(checks), known, None, {}, (), tuple(warnings))


def _numbers(measurements, excluded):
    """Numbers of all measured items, in the order of their first occurrence."""
    setups = {item.name: item for item in measurements.setups}
    points, sets, tools = {}, {}, {}

    def count(names):
        for name in names:
            if name not in excluded:
                points.setdefault(name, len(points))

    if measurements.image_points is not None:
        images = measurements.image_points
        count(name for name, check in zip(images.point, images.check, strict=True) if not check)
    for table in measurements.readings:
        kind = KINDS[table.table]
        use = np.flatnonzero(~np.asarray(table.check, dtype=bool)).tolist()
        for i in use:
            start = setups[table.setup[i]].station if table.setup else table.start[i]
            ends = (start, table.end[i], table.origin[i]) if table.origin else (start, table.end[i])
            count(ends)
            if kind.has("set") and not excluded.keys() & set(ends):
                sets.setdefault((table.setup[i], table.set[i] if table.set else None), len(sets))
            if kind.has("instrument"):
                tool = setups[table.setup[i]].instrument if table.setup else None
                tool = table.instrument[i] if table.instrument else tool
                if tool is not None:
                    tools.setdefault(tool, len(tools))
    known = {item.name: item for item in measurements.instruments}
    return Numbers(points, setups, tools, known, sets)


def _instruments(measurements, numbers):
    """Instruments of the network that measured distances."""
    used_tools = [numbers.tools[name] for name in numbers.instruments]
    return tuple(
        Instrument(tool.name, scale_sd=tool.u_scale, offset_sd_m=tool.u_offset_m)
        for tool in used_tools
    )


def _rows_in_survey_frame(control):
    """Row numbers of control in the frame of the survey, without check rows."""
    if control is None:
        return []
    systems = control.system or (None,) * len(control.point)
    return [
        i
        for i, (system, check) in enumerate(zip(systems, control.check, strict=True))
        if system is None and not check
    ]


def _known_control(control, points):
    """The Known control of the points of the survey."""
    xyz, sd = np.full((2, len(points), 3), np.nan)
    row = {}
    for i in _rows_in_survey_frame(control):
        number = points.get(control.point[i])
        if number is not None:
            # A point may occur in several rows, each with some of its coordinates.
            new = np.isfinite(control.xyz_m[i])
            xyz[number, new], sd[number, new] = control.xyz_m[i, new], control.sd_m[i, new]
            row.setdefault(control.point[i], control.rows[i] if control.rows else None)
    return KnownControl(xyz, sd, row)


def _coordinates(control, rows, points):
    """Single weighted coordinates of some rows: row, point, axis, value, sd, each (n,)."""
    rows = np.array([i for i in rows if control.point[i] in points], dtype=int)
    value, sd = control.xyz_m[rows], control.sd_m[rows]
    where, axis = np.nonzero(np.isfinite(value) & np.isfinite(sd))
    point = np.array([points[control.point[i]] for i in rows], dtype=int)
    return rows[where], point[where], axis, value[where, axis], sd[where, axis]


def _control(control, points, warnings, alone=frozenset()):
    """Weighted control coordinates as a list of one table, or an empty list."""
    if control is None:
        return []
    row, point, axis, value, sd = _coordinates(control, _rows_in_survey_frame(control), points)
    trace = _control_source(control, row, axis).trace()
    table = ControlCoordinates(value, sd, point, axis, trace=trace).taken(sd > 0)
    label = 3 * table.point + table.axis
    # Correlated values are not averaged: a mean would lose their covariance with other values.
    if alone:
        is_correlated = np.isin(table.trace.rows, list(alone))
        label = np.where(is_correlated, 3 * len(points) + np.arange(len(label)), label)
    averaged = average_repeated(
        table, label, warnings, name_of=lambda ids, element: f"{ids[0]} {element[0]}"
    )
    return [averaged] if len(averaged) else []


def _control_source(control, rows, axis, group=()):
    """Source of single coordinates of control."""
    return Source(
        control.file,
        tuple(control.rows[i] for i in rows) if control.rows else (),
        tuple((control.point[i],) for i in rows),
        tuple((AXES[k],) for k in axis),
        group,
    )


def held_trace(known, points):
    """Trace of held coordinates, numbered 3 point + axis."""
    return Source(
        "control.csv",
        tuple(known.row.get(name) for name in points for _ in AXES),
        tuple((name,) for name in points for _ in AXES),
        tuple((axis,) for axis in AXES) * len(points),
    ).trace()


def _systems(control, points):
    """Return further coordinate systems and a list of their coordinates."""
    if control is None:
        return (), []
    names = {}
    for system in control.system:
        if system is not None:
            names.setdefault(system, len(names))
    rows = [
        i
        for i, (system, check) in enumerate(zip(control.system, control.check, strict=True))
        if system is not None and not check
    ]
    row, point, axis, value, sd = _coordinates(control, rows, points)
    if not len(row):
        return (), []
    system = np.array([names[control.system[i]] for i in row])
    group = tuple(control.system[i] for i in row)
    trace = _control_source(control, row, axis, group=group).trace()
    coordinates = SystemCoordinates(value, sd, point, axis, system, trace=trace)
    return tuple(System(name) for name in names), [coordinates]


def _images(measurements, points, order, warnings):
    """Return the adjusted ImageCoordinates, and a list of those compared."""
    images = measurements.image_points
    sd = np.array(images.sd_mm, dtype=float)
    if measurements.settings.image_sd_mm is not None:
        sd = np.where(np.isnan(sd), measurements.settings.image_sd_mm, sd)
    _refuse_missing_sd(images, sd)
    photo = np.array([order.get(name, -1) for name in images.photo], dtype=int)
    point = np.array([points.get(name, -1) for name in images.point], dtype=int)
    check = np.asarray(images.check, dtype=bool)
    is_usable = (photo >= 0) & (point >= 0)
    trace = _image_source(measurements).trace()
    all_images = ImageCoordinates(images.xy_mm, sd, point, photo, trace=trace)
    used = all_images.taken(is_usable & ~check)
    used = average_repeated(
        used, used.photo * len(points) + used.point, warnings,
        name_of=lambda ids, _: image_point_label(*ids),
    )  # fmt: skip
    compared = all_images.taken(is_usable & check)
    # The transformation error of a comparator is common to repeated readings, so it enters after
    # averaging.
    used, compared = (
        part if images.shared_sd_mm is None
        else replace(part, sd=np.hypot(part.sd, images.shared_sd_mm[part.trace.reading]))
        for part in (used, compared)
    )  # fmt: skip
    return used, [compared] if len(compared) else []


def _image_source(measurements):
    """Source of the image points, grouped by camera."""
    images = measurements.image_points
    cameras = {item.name: item.camera for item in measurements.photos}
    return Source(
        images.file,
        images.rows,
        tuple(zip(images.photo, images.point, strict=True)),
        (("x", "y"),) * len(images.photo),
        tuple(cameras.get(name, "") for name in images.photo),
    )


def _refuse_missing_sd(images, sd):
    """Raise InputError if an image point has no standard deviation."""
    missing = np.flatnonzero(np.isnan(sd).any(axis=1))
    if len(missing):
        row = images.rows[missing[0]] if images.rows else None
        raise InputError(
            Problem(
                images.file,
                message(
                    "sds_of_images_missing",
                    "{count} image points have no standard deviation; give sx_um and sy_um, or "
                    "adjustment.image_sd_um",
                    count=len(missing),
                ),
                row,
                "sx_um",
            )
        )


# ---- blocks of correlated values of a survey: vectors, and pairs listed in a table


def rows_of(correlated, table):
    """Set of the rows of a table that CorrelatedReadings (or None) name."""
    if correlated is None:
        return frozenset()
    is_in_table = np.array([[name == table for name in pair] for pair in correlated.tables])
    return frozenset(correlated.at[is_in_table].tolist())


def blocks_of(measurements, observations):
    """Return the Blocks of correlated values of a survey's observations.

    Returns
    -------
    tuple of Block

    Raises
    ------
    InputError
        If a block of correlations has no positive definite covariance matrix.
    """
    sources, rows, components, sds, places = [], [], [], [], {}
    pairs = []
    for source, observations_of_source in enumerate(observations):
        trace = observations_of_source.trace
        table = "control" if isinstance(observations_of_source, ControlCoordinates) else trace.table
        is_vector = table == "vectors"
        correlated_rows = rows_of(measurements.correlated, table)
        sd = np.reshape(
            observations_of_source.sd, (len(observations_of_source), observations_of_source.rows)
        )
        for row in range(len(observations_of_source)):
            # All components of a vector enter a block; of other tables only the listed rows do.
            if not is_vector and trace.rows[row] not in correlated_rows:
                continue
            axes = (
                observations_of_source.axis[row : row + 1]
                if table == "control"
                else np.arange(observations_of_source.rows)
            )
            for component, axis in enumerate(axes.tolist()):
                places[table, trace.rows[row], axis] = len(sources)
                sources.append(source)
                rows.append(row)
                components.append(component)
                sds.append(sd[row, component])
    pairs += _vector_correlations(measurements, places)
    pairs += _listed_correlations(measurements.correlated, places)
    return _split(np.array(sources), np.array(rows), np.array(components), np.array(sds), pairs)


def _vector_correlations(measurements, places):
    """Yield (place, place, r, (file, row, column)) for the components of each vector."""
    for table in measurements.readings:
        if table.table != "vectors":
            continue
        for i, row in enumerate(table.rows):
            for k, (a, b) in enumerate(((0, 1), (0, 2), (1, 2))):
                if ("vectors", row, a) in places:
                    ends = (places["vectors", row, axis] for axis in (a, b))
                    yield (*ends, table.correlation[i, k], (table.file, row, "r_xy"))


def _listed_correlations(correlated, places):
    """Yield (place, place, r, (file, row, column)) for listed pairs of adjusted values."""
    if correlated is None:
        return
    for i, tables in enumerate(correlated.tables):
        ends = [
            places.get((table, int(correlated.at[i, k]), int(correlated.axis[i, k])))
            for k, table in enumerate(tables)
        ]
        if None not in ends:
            yield (*ends, correlated.r[i], (correlated.file, correlated.rows[i], "r"))


def _split(sources, rows, components, sds, pairs):
    """Split the correlated values into independent Blocks.

    Parameters
    ----------
    sources, rows, components : ndarray of int, shape (n,)
        Table, row and component of each value.
    sds : ndarray, shape (n,)
    pairs : list of tuple
        (place, place, r, (file, row, column)).

    Returns
    -------
    tuple of Block

    Raises
    ------
    InputError
        If a correlation matrix is not positive definite, or a standard deviation is 0.
    """
    if not len(sources):
        return ()
    n = len(sources)
    a, b = (np.array([pair[k] for pair in pairs], dtype=int) for k in (0, 1))
    _, first = np.unique(np.column_stack([sources, rows]), axis=0, return_inverse=True)
    of_row = np.full(first.max() + 1, -1)
    of_row[first[::-1]] = np.arange(n)[::-1]
    # Components of a row stay in one block even without a listed correlation: an observation is
    # adjusted as a whole.
    ties = np.concatenate([a, np.arange(n)]), np.concatenate([b, of_row[first.ravel()]])
    # Connected components of the graph of pairs are mutually uncorrelated.
    graph = coo_array((np.ones(len(ties[0])), ties), shape=(n, n))
    count, label = connected_components(graph, directed=False)
    r = np.eye(n)
    r[a, b] = r[b, a] = [pair[2] for pair in pairs]
    blocks = []
    for block in range(count):
        members = np.flatnonzero(label == block)
        # Sort by source, row and component, the order in which observations list their values.
        members = members[np.lexsort([components[members], rows[members], sources[members]])]
        part = r[np.ix_(members, members)]
        if np.linalg.eigvalsh(part)[0] < SMALLEST or not (sds[members] > 0).all():
            _refuse(len(members), next(pair[3] for pair in pairs if pair[0] in members))
        covariance = part * np.outer(sds[members], sds[members])
        blocks.append(Block(sources[members], rows[members], components[members], covariance))
    return tuple(blocks)


def _refuse(count, place):
    file, row, column = place
    text = message(
        "impossible_correlations",
        "these correlations of {count} values are not possible together: no covariance matrix has"
        " them (its smallest eigenvalue is not positive, or a standard deviation is 0)",
        count=count,
    )
    raise InputError(Problem(file, text, row, column))


# ---- points without observations

SHOWN = 5  # points in a sentence


def find_left_out(survey):
    """{point: reason} of the points with too few observations."""
    plan, height, rows, rays, measured = _counts(survey)
    held = np.zeros((len(survey.points), 3), dtype=bool) if survey.fixed is None else survey.fixed
    plan_held, height_held = held[:, :2].sum(axis=1), held[:, 2]
    in_plan, in_height = plan > 0, height > 0
    # A point observed in plan needs two values, one observed in height needs one.
    needed = 2 * in_plan + in_height
    have = rows + plan_held * in_plan + height_held * in_height
    # Enough values in total may still lack one of the plan coordinates.
    poor = (have < needed) | (in_plan & (plan + plan_held < 2)) | ~measured
    return {
        survey.points[i]: _why(survey.points[i], rays[i], rows[i], needed[i], measured[i])
        for i in np.flatnonzero(poor)
    }


def _why(name, rays, rows, needed, measured):
    """Reason for leaving out a point."""
    if not measured:
        return unmeasured_sentence(name)
    if rays == 1 and rows == 2:
        return one_ray_sentence(name)
    return message(
        "too_few_observations",
        "point {point} has too few observations: {count} for {needed} coordinates",
        point=name,
        count=rows,
        needed=needed,
    )


def unmeasured_sentence(name):
    """Sentence about a point without measurements."""
    return message("not_measured", "point {point} is not measured", point=name)


def find_untouched_coordinates(survey):
    """Mask (points, 3) of coordinates without observations, and warnings about them."""
    plan, height, _, _, _ = _counts(survey)
    idle = np.column_stack([plan == 0, plan == 0, height == 0])
    warnings = []
    for columns, what in ((slice(0, 2), join_with_and(["x", "y"])), (slice(2, 3), "z")):
        names = [survey.points[i] for i in np.flatnonzero(idle[:, columns].all(axis=1))]
        if names:
            text = message(
                "untouched",
                "{axes} of {points}: not observed by anything; the value given is kept, or 0",
                axes=what,
                points=list_some(names, SHOWN),
            )
            warnings.append(Problem("job.toml", text, None, "adjustment"))
    return idle, warnings


def _counts(survey):
    """Numbers of values for plan, height and all of each point; its rays; whether it is
    measured."""
    n = len(survey.points)
    plan, height, rows = np.zeros((3, n), dtype=int)
    rays, measured = np.zeros(n, dtype=int), np.zeros(n, dtype=bool)
    images = survey.image_points
    if images is not None:
        rays = np.bincount(images.point, minlength=n)
        measured |= rays > 0
        for counter in (plan, height, rows):
            counter += 2 * rays
    for table in survey.observations:
        if isinstance(table, ControlCoordinates):
            # Control coordinates count as readings of their points.
            flat = table.axis < 2
            np.add.at(plan, table.point[flat], 1)
            np.add.at(height, table.point[~flat], 1)
            np.add.at(rows, table.point, 1)
            continue
        if not table.ties:
            continue
        # Repeated readings of one line count once.
        _, lines = np.unique(
            [getattr(table, name) for name in table.ties], axis=1, return_index=True
        )
        for name in table.ties:
            count = table.rows * np.bincount(getattr(table, name)[lines], minlength=n)
            plan += count * (0 in table.axes)
            height += count * (2 in table.axes)
            rows += count
            measured |= (count > 0) & table.of_survey
    return plan, height, rows, rays, measured
