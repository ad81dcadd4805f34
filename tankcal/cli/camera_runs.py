"""Commands of `tankcal camera …`: input, analysis, output. They compute nothing themselves."""

import json
from dataclasses import replace
from pathlib import Path

import tankcal
from tankcal.errors import InputError, Problem
from tankcal.messages import message, printable
from tankcal.terminal import Progress, language_of_run, print_paths, say, speak, warn

HEAD_BYTES = 200  # start of a file that identifies a record


def parameters(options):
    """Test which additional parameters are significant."""
    from tankcal.calibration.interiors import count_sets
    from tankcal.calibration.parameters.analysis import analyse_job, analyse_record
    from tankcal.calibration.parameters.judgement import Choices
    from tankcal.record.camera import plain_parameters

    show = _start(options)
    choices = Choices(
        alpha=options.alpha, of=options.matrix, limit_px=options.limit_px, limit_um=options.limit_um
    )
    selection = {"camera": options.camera, "photo": options.photo}
    job, record = None, _load_record(options.source)
    if record is not None:
        analyses = analyse_record(record, choices, **selection)
    else:
        job = _load_job(options.source, show, options.language)
        _refuse_several(options, count_sets(job.network, **selection))
        analyses = analyse_job(
            job, choices, **selection, dropping=not options.no_trials, progress=show.part
        )
    paths = [] if job is not None else [options.source]
    _show_results(
        [plain_parameters(analysis) for analysis in analyses], options, show, paths, job, record
    )


def compare(options):
    """Compare all pairs of calibrations."""
    from tankcal.calibration.stability.comparison import compare as compare_calibrations
    from tankcal.calibration.stability.fits import parse_grid, parse_terrain
    from tankcal.job.calibrations import choose, read_cameras, with_pixels
    from tankcal.record.camera import plain_stability, summary

    show = _start(options)
    warnings = []
    pixel_um = options.pixel_um
    cameras = read_cameras(options.cameras, warnings.append, in_pixels=pixel_um is None)
    name = Path(options.cameras).name
    comparison = compare_calibrations(
        choose(with_pixels(cameras, pixel_um), options.names, name),
        options.method,
        grid=None if options.grid is None else parse_grid(options.grid),
        terrain=None if options.terrain is None else parse_terrain(options.terrain),
        threshold_px=options.threshold,
        as_published=options.as_published,
        seed=options.seed,
        file=name,
    )
    warn(warnings)
    _show_results(
        [plain_stability(comparison)], options, show, [options.cameras], printed=summary(comparison)
    )


def influence(options):
    """Compare the adjustments of one survey with several calibrations."""
    from tankcal.calibration.influence.runs import influence as compute_influence
    from tankcal.job.calibrations import read_cameras
    from tankcal.record.camera import plain_influence

    show = _start(options)
    warnings = []
    calibrations = read_cameras(options.cameras, warnings.append, in_pixels=False)
    job = _load_job(options.job, show, options.language)
    effects = compute_influence(
        job,
        calibrations,
        states=options.states,
        camera=options.camera,
        progress=show.part,
        file=Path(options.cameras).name,
    )
    warn(warnings)
    _show_results([plain_influence(effects)], options, show, [options.cameras], job)


def check(options):
    """Evaluate differences at check points with a table of limits."""
    from tankcal.calibration import product as limits
    from tankcal.calibration.product import check_product
    from tankcal.calibration.product.differences import collect_differences, read_differences
    from tankcal.record.camera import plain_product

    show = _start(options)
    table = limits.read_limits(options.limits) if options.limits else limits.shipped_limits()
    if options.scale is not None:
        table = limits.limits_of_scale(table, options.scale)
    job, record = None, _load_record(options.source)
    if record is not None:
        differences = collect_differences(record)
    elif Path(options.source).suffix.lower() == ".csv":
        differences = read_differences(options.source, options.separator, options.decimal)
    else:
        job = _load_job(options.source, show, options.language)
        differences = collect_differences(tankcal.adjust_job(job, show.step))
    axes, values = differences.select_known_axes()
    checked = check_product(
        values, axes, names=differences.names, limits=table, alpha=options.alpha
    )
    paths = [] if job is not None else [options.source]
    paths += [options.limits] if options.limits else []
    _show_results([plain_product(checked)], options, show, paths, job, record)


def convert(options):
    """Convert cameras to the form of another program or publication."""
    import numpy as np

    from tankcal.camera.formats.reading import write_camera

    speak(options.language)
    cameras, covariances = _read_cameras(options)
    if options.name is not None:
        cameras, covariances = _select_camera(options, cameras, covariances)
    for name, camera in cameras:
        _warn_of_error(message("convert_as_read", "{name}, as read", name=name), camera)
    if options.form is not None:
        cameras, covariances = _convert_to_form(options.form, cameras, covariances)
        for name, camera in cameras:
            what = message(
                "convert_in_form", "{name}, in the form of {form}", name=name, form=options.form
            )
            _warn_of_error(what, camera)
    sds = [
        None if covariance is None else np.sqrt(np.maximum(np.diag(covariance), 0.0))
        for covariance in covariances
    ]
    file = Path(options.file).name
    written = write_camera(options.to, cameras, sds, options.radius_mm, file)
    if options.to != "cameras.toml":
        for (name, camera), error_px in zip(cameras, written.error_px, strict=True):
            what = message("convert_as", "{name}, as {form}", name=name, form=options.to)
            _warn_of_error(what, replace(camera, error_px=error_px))
    if options.out is None:
        print(written.text, end="")
        return
    _write_new(Path(options.out), written.text)


def _convert_to_form(form, cameras, covariances):
    """Return [(name, FramedCamera)] in the form of a publication, and covariances or None."""
    from tankcal.camera.formats.published import convert_to_publication

    converted = [
        (name, *convert_to_publication(camera, form, covariance))
        for (name, camera), covariance in zip(cameras, covariances, strict=True)
    ]
    return [(name, camera) for name, camera, _ in converted], [after for *_, after in converted]


def _read_cameras(options):
    """Return [(name, FramedCamera)] of a file, and the covariance (13, 13) of each, or None."""
    from tankcal.calibration.interiors import read_framed_cameras
    from tankcal.camera.formats.reading import read_camera

    if options.kind is None and _is_record(options.file):
        pixel_mm = options.pixel_um and options.pixel_um / 1000
        return read_framed_cameras(_load_record(options.file), pixel_mm)
    is_register = options.kind is None and Path(options.file).suffix.lower() == ".toml"
    if is_register or options.kind == "cameras.toml":
        return _read_cameras_toml(options.file, options.pixel_um)
    size_px = None if options.size_px is None else tuple(options.size_px)
    cameras = read_camera(options.file, options.kind, options.pixel_um, size_px)
    return cameras, [None] * len(cameras)


def _read_cameras_toml(path, pixel_um):
    """Return [(name, FramedCamera)] of a cameras.toml, and covariances from standard deviations."""
    import numpy as np

    from tankcal.camera.formats.frame import make_film_camera, make_framed_camera
    from tankcal.job.calibrations import read_cameras, with_pixels

    setups = with_pixels(read_cameras(path, in_pixels=False), pixel_um)
    cameras = []
    for setup in setups:
        values, form = setup.camera.values, setup.camera.form
        if setup.pixel_mm is None:
            camera = make_film_camera(values, form, setup.format_mm)
        else:
            camera = make_framed_camera(values, form, setup.pixel_mm, setup.format_px)
        cameras.append((setup.camera.name, camera))
    return cameras, [np.diag(setup.camera.sd**2) for setup in setups]


def _select_camera(options, cameras, covariances):
    """Return the camera with the requested name only."""
    names = [name for name, _ in cameras]
    if options.name not in names:
        expected = message(
            "camera_no_such_name",
            "found --name {found!r}; expected one of {known}",
            found=options.name,
            known=", ".join(names[:20]),
        )
        raise InputError(Problem(Path(options.file).name, expected))
    place = names.index(options.name)
    return [cameras[place]], [covariances[place]]


def _warn_of_error(what, camera):
    """Warn of the largest difference of a fitted camera within the frame."""
    if camera.error_px > 1e-9:
        away = message("convert_px", "{error:.2g} px", error=camera.error_px)
        if camera.film_mm is not None:
            away = message("convert_um", "{error:.2g} um", error=camera.error_um)
        text = message(
            "convert_fitted",
            "{what}: fitted, differs by up to {away} within the frame",
            what=what,
            away=away,
        )
        warn([text])


def _write_new(target, text):
    """Write a new file; raise InputError if it exists."""
    try:
        with target.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise InputError(
            Problem(
                target.name,
                message("camera_file_exists", "exists; expected the name of a new file"),
            )
        ) from error
    say(message("convert_wrote", "wrote {file}", file=str(target)))


def read(options):
    """Measure targets in photographs and write image_points.csv."""
    from tankcal.calibration.targets import TargetSettings, read_photographs

    speak(options.language)
    show = Progress(options.quiet)
    wanted = TargetSettings(
        what=options.what,
        dictionary=options.dictionary,
        names=options.names,
        places=options.places,
        reach_px=options.reach_px,
        smallest_px=options.smallest_px,
        largest_px=options.largest_px,
        bit_errors=options.bit_errors,
        encoding=options.encoding,
    )
    result = read_photographs(options.photos, options.out, wanted, options.replace, show.part)
    show.end()
    warn(result.warnings)
    refused = sum(result.refused.values())
    reasons = ", ".join(f"{code} {count}" for code, count in sorted(result.refused.items()))
    say(
        message(
            "targets_read",
            "{targets}, {points} in {photos}; refused: {refused}{reasons}",
            targets=_count_targets(result.targets),
            points=_count_image_points(result.points),
            photos=_count_photos(len(result.photos)),
            refused=refused,
            reasons=f" ({reasons})" if refused else "",
        )
    )
    print(f"  {printable(result.path)}\n  {printable(result.refused_path)}")


def _count_targets(count):
    """Message of a number of targets."""
    if count == 1:
        return message("one_target", "1 target")
    if count == 0:
        return message("no_targets", "no targets")
    return message("some_targets", "{count} targets", count=count)


def _count_image_points(count):
    """Message of a number of image points."""
    if count == 1:
        return message("one_image_point", "1 image point")
    if count == 0:
        return message("no_image_points", "no image points")
    return message("some_image_points", "{count} image points", count=count)


def _count_photos(count):
    """Message of a number of photos."""
    if count == 1:
        return message("one_photo_read", "1 photo")
    return message("some_photos_read", "{count} photos", count=count)


def _start(options):
    """Return the Progress; refuse a folder with other files before any computation."""
    from tankcal.report import camera as camera_papers

    if options.out is not None:
        camera_papers.refuse_foreign(options.out)
    speak(options.language)
    return Progress(options.quiet)


def _load_job(source, show, language):
    """Return the job, with its tank if it has one."""
    from tankcal.terminal import read_job_language

    language = language or read_job_language(source)
    if language is not None:
        speak(language)
    show.step(message("camera_reading", "reading {source}", source=str(source)))
    job = tankcal.load(source, only="adjustment")
    return job if job.tank is None else tankcal.load(source)


def _load_record(source):
    """Return the record if `source` is a record, else None."""
    if Path(source).suffix.lower() != ".json":
        return None
    from tankcal.record import load

    return load(source)


def _is_record(source):
    """Return whether a JSON file is a record, from its first bytes."""
    if Path(source).suffix.lower() != ".json" or not Path(source).is_file():
        return False
    with Path(source).open("rb") as file:
        return b'"tankcal-record/' in file.read(HEAD_BYTES)


def _show_results(results, options, show, paths, job=None, record=None, printed=None):
    """Print tables or JSON, and write reports on request."""
    from tankcal.report import camera as camera_papers

    language = options.language or _find_language(job, record) or language_of_run()
    speak(language)
    _refuse_several(options, len(results))
    origin = camera_papers.describe_origin(paths, job)
    results = [result | {"made_from": origin} for result in results]
    written = []
    if options.out is not None:
        written = camera_papers.write(results[0], options.out, show.part, language)
    show.end()
    if options.json:
        whole = results[0] if len(results) == 1 else results
        print(json.dumps(whole if printed is None else printed, indent=1, allow_nan=False))
        return
    for result in results:
        for line in camera_papers.lines(result, language):
            print(line)
    if written:
        print_paths(options.out, written)


def _find_language(job, record):
    """Return the language of a job or a record, or None."""
    from tankcal.text.words import language_of

    if record is not None:
        return language_of(record)
    return job.table.language if job is not None and job.table is not None else None


def _refuse_several(options, count):
    """Raise InputError for --out with several sets of parameters."""
    if options.out is not None and count > 1:
        several = message(
            "camera_several_sets",
            "there are {count} sets of parameters; expected --camera or --photo, to select the "
            "set to write",
            count=count,
        )
        raise InputError(Problem("--out", several))
