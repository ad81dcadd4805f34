"""`tankcal camera`: which parameters belong, comparison and influence of calibrations, and more."""

from tankcal.cli import camera_runs as runs
from tankcal.cli.arguments import add_language, parse_count, positive, refuse_argument, share
from tankcal.messages import message


def add(commands):
    """The parsers of `tankcal camera …`."""
    camera = commands.add_parser(
        "camera",
        help="cameras: their parameters, calibrations, targets and file formats",
        description="Examine, compare and convert cameras and their calibrations, and read targets "
        "from photographs. docs/camera.md says what is computed and how to read it.",
    )
    camera.set_defaults(command=None, shown=camera)
    kinds = camera.add_subparsers(metavar="WHAT")
    for add_one in (_parameters, _compare, _influence, _check, _convert, _read):
        add_one(kinds)


def _parameters(kinds):
    one = kinds.add_parser(
        "parameters",
        help="which additional parameters belong in the model",
        description="Standard deviations, correlations, F tests, principal components, effect at "
        "the edge of the frame, and what dropping a parameter does to points and volume. A "
        "record.json serves for all but the last.",
    )
    one.add_argument("source", metavar="JOB", help="a job, or the record.json of one")
    one.add_argument("--camera", metavar="NAME", help="this camera only (default: all)")
    one.add_argument("--photo", metavar="NAME", help="the parameters of this photo only")
    one.add_argument("--alpha", type=share, default=0.05, help="level of the tests (default 0.05)")
    one.add_argument(
        "--matrix",
        choices=("correlation", "covariance"),
        default="correlation",
        help="that the principal components are taken of (default: correlation)",
    )
    one.add_argument(
        "--limit-px",
        metavar="PX",
        type=positive,
        help="image accuracy that effects are compared with (default: that of the residuals)",
    )
    one.add_argument("--limit-um", metavar="UM", type=positive, help="the same in micrometres")
    one.add_argument(
        "--no-trials",
        action="store_true",
        help="do not adjust the survey again without each parameter",
    )
    _add_outputs(one)
    one.set_defaults(command=runs.parameters)


def _compare(kinds):
    one = kinds.add_parser(
        "compare",
        help="are two calibrations of a camera the same?",
        description="All pairs of the calibrations in a cameras.toml: figure in pixels, verdict by "
        "a threshold, and where in the frame they differ.",
    )
    one.add_argument("cameras", metavar="CAMERAS.toml")
    one.add_argument(
        "names",
        metavar="NAME",
        nargs="*",
        help="only these, in this order (default: all, in the order of the file)",
    )
    one.add_argument(
        "--method",
        choices=("mis", "zrot", "rot", "spr"),
        default="zrot",
        help="mis: same principal distance and orientation; zrot: scaled to the same principal "
        "distance (default); rot: rotated onto each other; spr: resection on points of a terrain",
    )
    one.add_argument("--grid", metavar="COLUMNSxROWS,START,START,STEP", help="of image points, px")
    one.add_argument(
        "--terrain", metavar="I|II|LOW,RANGE", help="of spr: heights in m (default: I)"
    )
    one.add_argument(
        "--pixel-um", type=positive, help="of film: pixels that the figures are counted in"
    )
    one.add_argument("--seed", type=parse_count, default=1, help="of the terrain (default 1)")
    one.add_argument(
        "--threshold", metavar="PX", type=positive, default=0.5, help="default 0.5; 0.33 is usual"
    )
    one.add_argument(
        "--as-published", action="store_true", help="with the conventions of Pessoa 2017, named"
    )
    _add_outputs(one)
    one.set_defaults(command=runs.compare)


def _influence(kinds):
    one = kinds.add_parser(
        "influence",
        help="what does a wrong calibration do?",
        description="The same survey adjusted with each of several calibrations, fixed, "
        "weighted and free: orientation, residuals, points, check points and volume, all pairs.",
    )
    one.add_argument("job", metavar="JOB", help="a job folder, its job.toml, or a job workbook")
    one.add_argument("--cameras", metavar="CAMERAS.toml", required=True)
    one.add_argument("--camera", metavar="NAME", help="of the job, where it has several")
    one.add_argument(
        "--states",
        type=_states,
        default=("fixed", "weighted", "free"),
        help="some of fixed,weighted,free (default: all)",
    )
    _add_outputs(one)
    one.set_defaults(command=runs.influence)


def _check(kinds):
    one = kinds.add_parser(
        "check",
        help="is the product good enough?",
        description="Differences at check points: bias, precision, RMSE before and after removing "
        "a significant bias, class by a table of limits.",
    )
    one.add_argument(
        "source",
        metavar="FILE",
        help="a record.json, a job, or a CSV with point, dx_m, dy_m, dz_m",
    )
    one.add_argument(
        "--separator", choices=(",", ";"), default=",", help="of the CSV (default: the comma)"
    )
    one.add_argument(
        "--decimal", choices=(".", ","), default=".", help="mark of the CSV (default: the point)"
    )
    one.add_argument("--limits", metavar="FILE.toml", help="another table of limits")
    one.add_argument(
        "--scale", metavar="N", type=positive, help="only this scale, 1:N (default: all)"
    )
    one.add_argument("--alpha", type=share, default=0.05, help="level of the tests (default 0.05)")
    _add_outputs(one)
    one.set_defaults(command=runs.check)


def _convert(kinds):
    one = kinds.add_parser(
        "convert",
        help="cameras of other programs, both ways",
        description="Cameras of OpenCV, COLMAP, Metashape, Pix4D, AICON, a cameras.toml or a "
        "record.json into each other; where the forms differ the error over the frame is printed.",
    )
    one.add_argument("file", metavar="FILE")
    one.add_argument(
        "--to",
        required=True,
        metavar="FORM",
        help="cameras.toml, opencv, opencv-json, colmap, metashape, pix4d or aicon",
    )
    one.add_argument(
        "--from", dest="kind", metavar="FORM", help="one of the same, where the file does not tell"
    )
    one.add_argument(
        "--pixel-um",
        type=positive,
        help="height of a pixel, where the file has none and the form that is read or written"
        " counts in pixels",
    )
    one.add_argument(
        "--size-px",
        type=parse_count,
        nargs=2,
        metavar=("COLUMNS", "LINES"),
        help="where the file has none",
    )
    one.add_argument(
        "--radius-mm", type=positive, default=0.0, help="R0 of the balanced form aicon (default 0)"
    )
    one.add_argument("--name", help="only this camera of the file")
    one.add_argument(
        "--as",
        dest="form",
        choices=("silva", "pessoa", "dbat", "plain"),
        help="first into the convention and affinity of a publication",
    )
    one.add_argument("--out", metavar="FILE", help="where to write (default: the terminal)")
    add_language(one)
    one.set_defaults(command=runs.convert)


def _read(kinds):
    one = kinds.add_parser(
        "read",
        help="coded targets and white circles from photographs into image_points.csv",
        description="Reads ArUco and AprilTag targets, or white circular ones, and writes "
        "image_points.csv beside a list of what was refused. Needs the extra tankcal[images].",
    )
    one.add_argument("photos", metavar="PHOTO", nargs="+")
    one.add_argument("--out", metavar="FILE", default="image_points.csv")
    one.add_argument("--names", metavar="FILE", help="CSV of id and point; other ids are refused")
    one.add_argument(
        "--places",
        metavar="FILE",
        help="of circles: CSV of photo, point, column_px, line_px, about where each is",
    )
    one.add_argument(
        "--dictionary", default="DICT_5X5_100", help="of the codes (default: DICT_5X5_100)"
    )
    one.add_argument(
        "--what",
        choices=("corners", "centres", "circles"),
        default="corners",
        help="corners NAME-1 to NAME-4 of coded targets (default), their centres, or circles",
    )
    for name, value, text in (
        ("reach-px", 15.0, "of circles: how far from its place (default 15)"),
        ("smallest-px", None, "least side or diameter (default: 2.5 a cell; 6)"),
        ("largest-px", None, "of circles: largest diameter (default: a tenth of the photo)"),
    ):
        one.add_argument(f"--{name}", metavar="PX", type=positive, default=value, help=text)
    one.add_argument(
        "--bit-errors",
        type=parse_count,
        default=0,
        help="cells of a code that may be wrong (default 0)",
    )
    one.add_argument(
        "--encoding",
        choices=("by_file", "linear", "srgb"),
        default="by_file",
        help="how grey values stand for light (default: sRGB in JPEG, else as stored)",
    )
    one.add_argument("--replace", action="store_true", help="overwrite an earlier list")
    one.add_argument("--quiet", action="store_true", help="no progress, only problems")
    add_language(one)
    one.set_defaults(command=runs.read)


def _add_outputs(parser):
    parser.add_argument("--json", action="store_true", help="print JSON, not tables")
    parser.add_argument("--out", metavar="DIR", help="also write tables, figures and a report")
    add_language(parser)
    parser.add_argument("--quiet", action="store_true", help="no progress, only problems")


def _states(text):
    states = tuple(part.strip() for part in text.split(","))
    if not set(states) <= {"fixed", "weighted", "free"}:
        raise refuse_argument(
            message(
                "option_states", "found {text!r}; expected some of fixed,weighted,free", text=text
            )
        )
    return states
