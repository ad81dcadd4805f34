"""`tankcal camera`: parameters, calibrations, targets and file formats of cameras."""

from tankcal.cli import camera_runs as runs
from tankcal.messages import message
from tankcal.terminal import (
    add_language,
    parse_count,
    parse_positive,
    parse_share,
    refuse_argument,
)


def add(commands):
    """Add the parsers of `tankcal camera …`."""
    camera = commands.add_parser(
        "camera",
        help="cameras: their parameters, calibrations, targets and file formats",
        description="Examine, compare and convert cameras and their calibrations, and measure "
        "targets in photographs. docs/camera.md describes the methods and the results.",
    )
    camera.set_defaults(command=None, shown=camera)
    kinds = camera.add_subparsers(metavar="WHAT")
    for add_one in (_parameters, _compare, _influence, _check, _convert, _read):
        add_one(kinds)


def _parameters(kinds):
    parser = kinds.add_parser(
        "parameters",
        help="which additional parameters are significant",
        description="Report standard deviations, correlations, F tests, principal components and "
        "the effect at the edge of the frame of the additional parameters. For a job, also report "
        "the changes of points and volume without each parameter.",
    )
    parser.add_argument("source", metavar="JOB", help="a job, or a record.json")
    parser.add_argument("--camera", metavar="NAME", help="this camera only (default: all)")
    parser.add_argument("--photo", metavar="NAME", help="the parameters of this photo only")
    parser.add_argument(
        "--alpha", type=parse_share, default=0.05, help="level of the tests (default 0.05)"
    )
    parser.add_argument(
        "--matrix",
        choices=("correlation", "covariance"),
        default="correlation",
        help="matrix of the principal components (default: correlation)",
    )
    parser.add_argument(
        "--limit-px",
        metavar="PX",
        type=parse_positive,
        help="image accuracy for the assessment of effects (default: from the residuals)",
    )
    parser.add_argument(
        "--limit-um", metavar="UM", type=parse_positive, help="image accuracy in micrometres"
    )
    parser.add_argument(
        "--no-trials",
        action="store_true",
        help="do not repeat the adjustment without each parameter",
    )
    _add_outputs(parser)
    parser.set_defaults(command=runs.parameters)


def _compare(kinds):
    parser = kinds.add_parser(
        "compare",
        help="test whether calibrations of a camera agree",
        description="Compare all pairs of calibrations in a cameras.toml: difference in pixels, "
        "verdict by a threshold, and distribution of the differences over the frame.",
    )
    parser.add_argument("cameras", metavar="CAMERAS.toml")
    parser.add_argument(
        "names",
        metavar="NAME",
        nargs="*",
        help="calibrations to compare, in this order (default: all, in the order of the file)",
    )
    parser.add_argument(
        "--method",
        choices=("mis", "zrot", "rot", "spr"),
        default="zrot",
        help="mis: same principal distance and orientation; zrot: scaled to the same principal "
        "distance (default); rot: rotated onto each other; spr: resection on points of a terrain",
    )
    parser.add_argument(
        "--grid", metavar="COLUMNSxROWS,START,START,STEP", help="grid of image points, px"
    )
    parser.add_argument(
        "--terrain", metavar="I|II|LOW,RANGE", help="for spr: heights in m (default: I)"
    )
    parser.add_argument(
        "--pixel-um",
        metavar="UM",
        type=parse_positive,
        help="for film: pixel size for differences in pixels",
    )
    parser.add_argument(
        "--seed", metavar="N", type=parse_count, default=1, help="seed of the terrain (default 1)"
    )
    parser.add_argument(
        "--threshold",
        metavar="PX",
        type=parse_positive,
        default=0.5,
        help="largest difference between calibrations that agree (default 0.5; 0.33 is usual)",
    )
    parser.add_argument(
        "--as-published",
        action="store_true",
        help="use the conventions of Pessoa 2017, and name them",
    )
    _add_outputs(parser)
    parser.set_defaults(command=runs.compare)


def _influence(kinds):
    parser = kinds.add_parser(
        "influence",
        help="determine the effect of a wrong calibration",
        description="Adjust one survey with each of several calibrations, fixed, weighted and "
        "free. Compare orientation, residuals, points, check points and volume of all pairs.",
    )
    parser.add_argument("job", metavar="JOB", help="a job folder, its job.toml, or a job workbook")
    parser.add_argument("--cameras", metavar="CAMERAS.toml", required=True)
    parser.add_argument(
        "--camera", metavar="NAME", help="camera of the job, if the job has several"
    )
    parser.add_argument(
        "--states",
        metavar="STATES",
        type=_states,
        default=("fixed", "weighted", "free"),
        help="one or more of fixed,weighted,free (default: all)",
    )
    _add_outputs(parser)
    parser.set_defaults(command=runs.influence)


def _check(kinds):
    parser = kinds.add_parser(
        "check",
        help="test a product at check points",
        description="Evaluate differences at check points: bias, precision, RMSE before and after "
        "removal of a significant bias, and class by a table of limits.",
    )
    parser.add_argument(
        "source",
        metavar="FILE",
        help="a record.json, a job, or a CSV with point, dx_m, dy_m, dz_m",
    )
    parser.add_argument(
        "--separator",
        choices=(",", ";"),
        default=",",
        help="separator of the CSV file (default: the comma)",
    )
    parser.add_argument(
        "--decimal",
        choices=(".", ","),
        default=".",
        help="decimal mark of the CSV file (default: the point)",
    )
    parser.add_argument("--limits", metavar="FILE.toml", help="another table of limits")
    parser.add_argument(
        "--scale", metavar="N", type=parse_positive, help="this scale only, 1:N (default: all)"
    )
    parser.add_argument(
        "--alpha", type=parse_share, default=0.05, help="level of the tests (default 0.05)"
    )
    _add_outputs(parser)
    parser.set_defaults(command=runs.check)


def _convert(kinds):
    parser = kinds.add_parser(
        "convert",
        help="convert cameras from and to other programs",
        description="Convert cameras between OpenCV, COLMAP, Metashape, Pix4D, AICON and "
        "cameras.toml; a record.json can also be read. If the camera models differ, the largest "
        "difference within the frame is printed.",
    )
    parser.add_argument("file", metavar="FILE")
    parser.add_argument(
        "--to",
        required=True,
        metavar="FORM",
        help="cameras.toml, opencv, opencv-json, colmap, metashape, pix4d or aicon",
    )
    parser.add_argument(
        "--from",
        dest="kind",
        metavar="FORM",
        help="form of the file, if its content does not show it",
    )
    parser.add_argument(
        "--pixel-um",
        metavar="UM",
        type=parse_positive,
        help="height of a pixel, if the file does not contain it and a form in pixels is read or "
        "written",
    )
    parser.add_argument(
        "--size-px",
        type=parse_count,
        nargs=2,
        metavar=("COLUMNS", "LINES"),
        help="image size, if the file does not contain it",
    )
    parser.add_argument(
        "--radius-mm",
        metavar="MM",
        type=parse_positive,
        default=0.0,
        help="R0 of the balanced form aicon (default 0)",
    )
    parser.add_argument("--name", metavar="NAME", help="this camera of the file only")
    parser.add_argument(
        "--as",
        dest="form",
        choices=("silva", "pessoa", "dbat", "plain"),
        help="convert first to the convention and affinity of a publication",
    )
    parser.add_argument("--out", metavar="FILE", help="output file (default: the terminal)")
    add_language(parser)
    parser.set_defaults(command=runs.convert)


def _read(kinds):
    parser = kinds.add_parser(
        "read",
        help="measure coded targets and white circles in photographs",
        description="Measure ArUco and AprilTag targets, or white circular targets, and write "
        "image_points.csv and a list of rejected candidates. Requires the extra "
        "tankcal[images].",
    )
    parser.add_argument("photos", metavar="PHOTO", nargs="+")
    parser.add_argument("--out", metavar="FILE", default="image_points.csv")
    parser.add_argument(
        "--names", metavar="FILE", help="CSV file with id and point; other ids are rejected"
    )
    parser.add_argument(
        "--places",
        metavar="FILE",
        help="for circles: CSV file with photo, point, column_px, line_px: approximate places",
    )
    parser.add_argument(
        "--dictionary",
        metavar="DICTIONARY",
        default="DICT_5X5_100",
        help="dictionary of the codes (default: DICT_5X5_100)",
    )
    parser.add_argument(
        "--what",
        choices=("corners", "centres", "circles"),
        default="corners",
        help="corners NAME-1 to NAME-4 of coded targets (default), their centres, or circles",
    )
    for name, value, text in (
        ("reach-px", 15.0, "for circles: largest distance from the approximate place (default 15)"),
        ("smallest-px", None, "smallest side or diameter (default: 2.5 px per cell; 6 px)"),
        ("largest-px", None, "for circles: largest diameter (default: a tenth of the photo)"),
    ):
        parser.add_argument(
            f"--{name}", metavar="PX", type=parse_positive, default=value, help=text
        )
    parser.add_argument(
        "--bit-errors",
        metavar="N",
        type=parse_count,
        default=0,
        help="largest number of wrong cells in a code (default 0)",
    )
    parser.add_argument(
        "--encoding",
        choices=("by_file", "linear", "srgb"),
        default="by_file",
        help="relation of grey values and light (default: sRGB in JPEG, else as stored)",
    )
    parser.add_argument("--replace", action="store_true", help="overwrite an earlier list")
    parser.add_argument("--quiet", action="store_true", help="no progress, only problems")
    add_language(parser)
    parser.set_defaults(command=runs.read)


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
                "option_states",
                "found {text!r}; expected one or more of fixed,weighted,free",
                text=text,
            )
        )
    return states
