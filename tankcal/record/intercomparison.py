"""Intercomparison of software: package, sealed truth, answers and scores."""

from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Finite, Saved, WarningRecord, key

PACKAGE = SavedFormat("tankcal-intercomparison-package", 1, "manifest.json")
TRUTH = SavedFormat("tankcal-intercomparison-truth", 1, "truth.json")
ANSWERS = SavedFormat("tankcal-intercomparison-answers", 1, "answers.json")
SCORES = SavedFormat("tankcal-intercomparison-scores", 1, "scores.json")


# ---- the package


class FileHash(Saved):
    """A file of the package."""

    file: str = key("path within the package")
    sha256: str = key("hexadecimal digits")


class AskedTank(Saved):
    """The task for a tank, common to all methods."""

    tank: str = key("name")
    heights_m: list[Finite] = key("of the requested volumes, above the dip plate")
    reference_temperature_c: Finite = key("of the shell")
    liquid_density_kg_m3: Finite = key("of the head that widens the shell; 0: empty shell")


class AskedJob(Saved):
    """A survey of a tank."""

    tank: str = key("name")
    method: str = key("name")
    folder: str = key("of its files within the package")


class PackageFile(Saved):
    """Manifest of a package."""

    tankcal: str = key("version of tankcal")
    open: bool = key("whether it includes the truth, for practice")
    licence: str = key("SPDX name")
    coverage_probability: Finite = key("of the requested expanded uncertainties")
    truth_sha256: str = key("of the file truth.json, byte by byte: the commitment")
    tanks: list[AskedTank] = key("tasks")
    jobs: list[AskedJob] = key("every survey")
    files: list[FileHash] = key("all other files of the package")
    format: str = PACKAGE.format


# ---- the truth


class TrueTank(Saved):
    """A tank with its assigned values."""

    tank: str = key("name")
    family: str = key("of its defects")
    heights_m: list[Finite] = key("as requested")
    volume_m3: list[Finite] = key("assigned values")
    numerical_error_m3: Finite = key("the largest change of them by more nodes of the quadrature")
    shape: dict = key("the tank itself, from which the volumes can be computed again")


class TruthFile(Saved):
    """Data that remain sealed until all answers have arrived."""

    tankcal: str = key("version of tankcal")
    nonce: str = key("256 random bits, so that the hash of the file cannot be found by trying")
    secret: str = key('256 random bits that determine the draws with the seed; "": seed only')
    seed: int = key("of the draws")
    methods: list[str] = key("by which each tank was surveyed")
    tanks: list[TrueTank] = key("all of them")
    format: str = TRUTH.format


# ---- answers


class Participant(Saved):
    """A participant and the software used."""

    name: str = key("of the participant")
    software: str = key("that computed the answers")
    version: str = key("of the software")
    date: str | None = key("of the answers, year-month-day; null: not stated")
    contact: str | None = key("null: not stated")
    remarks: str | None = key("null: none")
    package: str = key("truth_sha256 of the package's manifest.json")


class Answer(Saved):
    """The table from a survey."""

    tank: str = key("name")
    method: str = key("name")
    height_m: list[Finite] = key("requested heights above the dip plate")
    volume_m3: list[Finite] = key("below these heights")
    U_m3: list[float] = key("expanded uncertainties; null: none is stated")
    k: list[float] = key("coverage factors; null: not stated")


class AnswersFile(Saved):
    """All answers of a participant."""

    participant: Participant = key("author of the answers")
    answers: list[Answer] = key("for each answered survey")
    format: str = ANSWERS.format


# ---- scores


class ScoredRows(Saved):
    """Errors of a table, row by row."""

    height_m: list[Finite] = key("above the dip plate")
    true_m3: list[Finite] = key("assigned values")
    error_m3: list[Finite] = key("answer less assigned value")
    U_m3: list[float] = key("as stated; null: none")
    E_n: list[float] = key("null: no U")
    zeta: list[float] = key("null: no U, or no k")


class TableForm(Saved):
    """Variation of the errors of a table along its height."""

    falling_rows: int = key("pairs of rows between which the volume does not rise")
    zero_m3: float | None = key("of the line a + b V through the errors; null: fewer than 4 rows")
    scale_ppm: float | None = key("b of this line")
    form_ppm: float | None = key("rms residual from this line, of the largest requested volume")
    delivery_1cm_percent: float | None = key("rms error of deliveries of 1 cm; null: none")
    delivery_10cm_percent: float | None = key("rms error of deliveries of 10 cm; null: none")
    delivery_2m_ppm: float | None = key("rms error of deliveries of 2 m; null: none")
    worst_2m_ppm: float | None = key("largest error of these deliveries, with its sign; null: none")


class ScoredTable(Saved):
    """A table of a participant."""

    participant: int = key("place in `participants`, 0 first")
    tank: str = key("name")
    method: str = key("name")
    rows: ScoredRows = key("row by row")
    missing: int = key("requested heights without an answer")
    top_error_ppm: float | None = key("at the largest requested height; null: no answer")
    top_E_n: float | None = key("at the largest requested height; null: no U")
    rms_ppm: Finite = key("rms error of the rows, of the largest requested volume")
    within: int = key("rows with |E_n| up to 1")
    judged: int = key("rows with an E_n")
    mean_U_ppm: float | None = key("of the largest requested volume; null: no U")
    rms_zeta: float | None = key("rms error over standard uncertainty; null: no k")
    form: TableForm = key("along the height")


class MethodScore(Saved):
    """All tables of a participant by a method."""

    participant: int = key("place in `participants`, 0 first")
    method: str = key("name; *: all methods")
    tables: int = key("answered")
    asked: int = key("surveys")
    bias_ppm: float | None = key("mean error at the top")
    u_bias_ppm: float | None = key("its standard deviation; null: fewer than 2 tables")
    rms_top_ppm: float | None = key("rms error at the top")
    rms_ppm: Finite = key("rms error of all rows")
    mean_U_ppm: float | None = key("null: no U")
    share_within: float | None = key("of rows, with |E_n| up to 1; null: no U")
    u_share: float | None = key("its standard deviation, tables counted as the independent units")
    tops_within: int = key("tables whose |E_n| at the top is up to 1")
    tops_judged: int = key("tables with an E_n at the top")
    tops_low: float | None = key("exact lower 95 % bound of their probability (binomial)")
    tops_high: float | None = key("upper bound")
    rms_zeta: float | None = key("1 where standard uncertainties are right; null: no k")
    form_ppm: float | None = key("rms of the tables' form_ppm")
    delivery_1cm_percent: float | None = key("rms")
    delivery_10cm_percent: float | None = key("rms")
    delivery_2m_ppm: float | None = key("rms")
    falling_rows: int = key("of all tables")


class ScoresFile(Saved):
    """Scores of all participants."""

    tankcal: str = key("version that scored")
    truth_sha256: str = key("of the truth, as committed and as opened")
    coverage_probability: Finite = key("as requested")
    participants: list[Participant] = key("as stated in the answers")
    tables: list[ScoredTable] = key("every table")
    methods: list[MethodScore] = key("by participant and method")
    warnings: list[WarningRecord] = key("of the answers")
    format: str = SCORES.format
