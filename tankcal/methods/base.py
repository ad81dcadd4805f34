"""`Method`, the base of all ways of measuring a wall, and the registry of the methods.

A method owns its tables, checks, readings, wall, warnings, saved part and report tables. The
packages of the main job contain no branch for it: they ask `methods()` or `methods_for(kind)`.

This module imports no package of tankcal, and the registry holds names only, because job, pipeline,
record and report lie below the methods and ask for them at run time. A method imports a module of
its own within the function that needs it, so that a job loads only the methods that it uses.
"""

from collections import Counter
from functools import cache, partial
from importlib import import_module
from typing import ClassVar

from tankcal.entry_points import find_entry_points

GROUP = "tankcal.methods"  # entry points of methods in other distributions
_BUILT_IN = (
    "tankcal.methods.points:PointsMethod",
    "tankcal.methods.strapping:StrappingMethod",
    "tankcal.methods.lines:LinesMethod",
    "tankcal.methods.hits:HitsMethod",
    "tankcal.methods.tangents:TangentsMethod",
    "tankcal.methods.clouds:CloudsMethod",
    "tankcal.methods.liquid:LiquidMethod",
    "tankcal.methods.radii:RadiiMethod",
    "tankcal.methods.rings:RingsMethod",
    "tankcal.methods.great_circles:GreatCirclesMethod",
    "tankcal.methods.inside_hits:InsideHitsMethod",
    "tankcal.methods.mesh:MeshMethod",
)


class Delegate:
    """Hook of a method that is a function of a module, "module:function", imported when called."""

    def __init__(self, path):
        self.path = path

    def __get__(self, method, owner=None):
        return _load(self.path)


class Import(Delegate):
    """Hook without arguments that returns a module, or an object of a module, "module:name"."""

    def __get__(self, method, owner=None):
        return partial(_load, self.path)


class Method:
    """A way of measuring the wall of a tank; a subclass overrides what differs from the default.

    Attributes
    ----------
    name : str
        Key of the readings in `Job.surveys`, of the survey in `Result.surveys`, of the saved part
        in the record, and of the sheet in the workbook. A survey that the method finds has this
        name as its attribute `surveyed_as`.
    attribute : str or None
        Attribute of `Job` with the readings, for methods whose attribute is in the documented
        interface; None: the readings are in `Job.surveys`.
    kinds : tuple of str
        Kinds of tank that the method can measure: "vertical", "horizontal", "sphere", "mesh".
    tables : tuple of str
        Tables of a job that belong to the method; the first table contains its readings.
    register : str or None
        List whose entries are the readings, such as "clouds"; they form a table of this name, with
        a row for each entry. None: the readings are in the first table.
    shared_tables : tuple of str
        Tables of other methods that the method also reads.
    archives : tuple of str
        Files of arrays that belong to these tables; `RawJob.archives` has their content.
    starter : str or None
        Value of `tankcal new --survey` that starts a job with these tables.
    starter_registers : tuple of str
        Lists in such a job.
    starter_has_network : bool
        Whether such a job has the settings of an adjustment.
    needs_station_heights : bool
        Whether the field sheets have a form for the heights of the stations.
    tables_with_sds : tuple of str
        Tables whose column s_mm or s_arcsec is checked for values below those of any reading.
    is_sighted : bool
        Whether the readings are sights that become points of an upright wall. `find` then returns
        a job with these points, and the sights.
    replaces_points : bool
        Whether a job with these readings needs no points of the wall.
    completes_survey : bool
        Whether the readings supply the courses that a survey of the wall does not measure.
    accompanies_points : bool
        Whether the readings may be joined with points of a wall. `warnings` and `choices` then also
        deal with the wall of these points.
    measures_size : bool
        Whether the readings determine the size of the tank without distances of instruments.
    is_inside : bool
        Whether the readings, without a survey, are sizes of the inside.
    is_supplement : bool
        Whether the readings supplement a survey by other methods, or the drawing; `supplement`
        combines them with it.
    has_means : bool
        Whether the points of the wall are means of many readings, not single sights.
    is_smooth : bool
        Whether the readings show the wall smoother than it is.
    has_own_offset : bool
        Whether the instruments have offsets of their own, so that the declared input "offset" of
        all radii has no effect.
    names_levels : bool
        Whether a section is named by its course and the sighted level.
    compares_size : bool
        Whether `warnings` compares the size of the whole tank with the drawing.
    computes_top : bool
        Whether the top of the tank is computed, to be compared with the reference height.
    counts_from_plate : bool
        Whether levels of the solid count from the dip plate.
    comes_last : bool
        Whether its forms and its instruments follow those of the other methods.
    field_forms : tuple of (tuple of str, int)
        Forms of the field sheets: the tables filled in together, and the rows on a sheet.
    field_facts : tuple of str
        Facts at the head of the field sheets; (): the facts of a survey of the wall.
    kind_of_readings : str
        Kind of its readings in plans: "straps", "offsets", "hits" or "tangents"; "": not planned
        by courses.
    csv_files : tuple of str
        Output files of `csv_tables`.
    hidden_sheets : tuple of str
        Sheets of the workbook for other programs, which are hidden.
    section_notes, table_notes : dict
        English notes in a starter above the sections of job.toml and above the tables.
    no_rows : Message or None
        Problem of a table of readings without rows, in place of points; None: no problem.
    saved_type : callable or None
        Function that returns the dataclass (a `record.schema.Saved`) of the saved part; None:
        nothing is saved.
    saved_note : str
        Description of the saved part in the JSON schema of the record.
    """

    name = ""
    attribute = None
    kinds = ()
    tables = ()
    register = None
    shared_tables = ()
    archives = ()
    starter = None
    starter_registers = ("instruments",)
    starter_has_network = True
    needs_station_heights = False
    tables_with_sds = ()
    is_sighted = False
    replaces_points = False
    completes_survey = False
    accompanies_points = False
    measures_size = False
    is_inside = False
    is_supplement = False
    has_means = False
    is_smooth = False
    has_own_offset = False
    names_levels = False
    compares_size = False
    computes_top = False
    counts_from_plate = False
    comes_last = False
    field_forms = ()
    field_facts = ()
    kind_of_readings = ""
    csv_files = ()
    hidden_sheets = ()
    section_notes: ClassVar = {}
    table_notes: ClassVar = {}
    no_rows = None
    saved_type = None
    saved_note = ""

    @property
    def has_named_points(self):
        """Whether points of the wall are single sights, each with the name "set-up row"."""
        return self.is_sighted and not self.has_means

    # ---- job

    @property
    def readings_table(self):
        """Name of the table with the readings."""
        return self.register or self.tables[0]

    def columns(self):
        """Columns of the tables: {table: tuple of `job.fields.Field`}."""
        return {}

    def settings(self):
        """Sections of job.toml: {section: tuple of `job.fields.Field`}."""
        return {}

    def register_fields(self):
        """Fields of an entry in lists of the method: {list: tuple of `job.fields.Field`}."""
        return {}

    def starter_tables(self):
        """Tables of a starter job, in their order."""
        return (*self.tables, *self.shared_tables)

    def starter_settings(self, kind):
        """Initial values of settings in a starter job for a kind of tank: {"survey.side": text}."""
        return {}

    def examples(self):
        """Example rows for the notes of a starter: {table: list of {column: value}}."""
        return {}

    def setting_examples(self):
        """Example values for a starter workbook: {"section.key" or "list.key": value}."""
        return {}

    def is_given(self, tables):
        """Whether a job contains readings of this method.

        Parameters
        ----------
        tables : dict
            {table: ColumnValues; None: missing}.
        """
        table = tables.get(self.readings_table)
        return table is not None and bool(table.rows or table.skipped)

    def check(self, values, tables, registers, raw, log):
        """Report problems of the tables and settings to `log`; called with or without readings.

        Parameters
        ----------
        values : dict or None
            {section: {key: value}} of the settings; None: unreadable.
        tables : dict
            {table: ColumnValues; None: missing}.
        registers : dict
            {"cameras", "instruments", "clouds" or "meters": {name: {key: value}}}.
        raw : RawJob
            Job as read.
        log : Log
            Receives problems and warnings.
        """

    def may_see_both_sides(self, tables):
        """Whether the readings of a job may be on both sides of the wall."""
        return False

    def useless_inputs(self, values, tables):
        """Inputs of uncertainty without effect beside these readings.

        Parameters
        ----------
        values, tables : dict
            As for `check`.

        Returns
        -------
        dict of {str: Message or ""}
            Reason for each input; "": the input has an effect.
        """
        return {}

    def estimate_diameter_m(self, tables):
        """Approximate diameter from the readings before any calculation, m; None: unknown."""
        return

    def read(self, values, tables, registers, raw):
        """Readings in SI from a job without problems, for `Job.surveys`; parameters as `check`."""
        raise NotImplementedError

    def readings_of(self, job):
        """Readings of this method in a `Job`; None without readings."""
        if self.attribute is not None:
            return getattr(job, self.attribute)
        return job.surveys.get(self.name)

    # ---- known walls

    def observe(self, job, wall, errors):
        """Readings of a `Job` as they would be on a known wall, for plans and simulations.

        Parameters
        ----------
        job : Job
            Job with readings of this method at the planned places.
        wall : planning.wall.tank_walls.RoundWall or DrawnWall
        errors : planning.wall.nominal_readings.Errors
            Errors of the readings; the methods draw them in their order.

        Returns
        -------
        object
            As `read`; without a wall to be read, the readings of the job.
        """
        return self.readings_of(job)

    def levels_read(self, job):
        """Set of (course, height above the table's zero, m) of the readings of a `Job`."""
        return set()

    def courses_of_readings(self, job):
        """Course of each reading of the wall of a `Job`, with repetitions."""
        return ()

    def instruments_in_use(self, job):
        """Names of the instruments of the readings of a `Job`, and of the masters of tapes."""
        return set()

    def detectable_m(self, job, wall, sights):
        """Minimal detectable blunder of each reading, m; inf: not controlled by other readings.

        Parameters
        ----------
        job : Job
        wall : object
            Survey of the job.
        sights : object
            Sights that `find` returned.

        Returns
        -------
        ndarray or tuple
            (): the readings have no test of their own.
        """
        return ()

    # ---- pipeline

    def finds(self, job):
        """Whether `find` determines the survey of a `Job` with readings of this method."""
        return True

    def find(self, job, progress, network):
        """Survey of the tank from the readings of a job.

        Parameters
        ----------
        job : Job
            Job with readings of this method.
        progress : callable
            Called with a message as a step begins.
        network : pipeline.surveying.Network
            Adjusted network of the job, and known amplitudes of the wall.

        Returns
        -------
        pipeline.surveying.Surveyed
            Its `survey` has the attribute `surveyed_as` and becomes an entry of `Result.surveys`;
            its `sights` become `Result.sights`.
        """
        raise NotImplementedError

    def courses_read(self, job):
        """Names of the courses that these readings determine beside points of other courses."""
        return set()

    def complete(self, job, survey, progress):
        """Survey of a tank from the survey of another method, completed by these readings.

        Parameters
        ----------
        job : Job
            Job with readings of this method.
        survey : object
            Survey that another method found.
        progress : callable
            As for `find`.

        Returns
        -------
        object
            Its attribute `surveyed` is the survey of the other method.
        """
        raise NotImplementedError

    def former_radii_m(self, job):
        """Radii of all courses, m, shape (courses,), for a method that completes a survey."""
        raise NotImplementedError

    def job_as_surveyed(self, job):
        """`Job` in the state of the surveyed wall: its side, temperature and liquid level."""
        return job

    def inside_radii(self, job, survey):
        """`InsideRadii` of a survey, to be compared with the drawing; None: no size is known."""
        return

    def part(self, job, survey, switches):
        """`tank.body.SolidPart` of a tank of a single solid; None: made from `solid_part`."""

    def solid_part(self, survey, plate_m, scale):
        """Inside of a tank of a single solid, with the arguments of its `SolidPart`.

        Parameters
        ----------
        survey : object
            Survey from `find`.
        plate_m : float
            Thickness of the plates to be subtracted, m.
        scale : float
            Lengths at the reference temperature over those of the survey.

        Returns
        -------
        solid : object
            Solid with volumes and areas by level, with lengths multiplied by `scale`.
        arguments : dict
            Further arguments of `tank.body.SolidPart`.
        unused : tuple of str
            Declared inputs without effect.
        """
        raise NotImplementedError

    def supplement(self, job, survey, progress):
        """Combine the readings with a survey; for a method that is a supplement.

        Parameters
        ----------
        job : Job
        survey : object
            Survey of the job.
        progress : callable
            Called with a message as a step begins.

        Returns
        -------
        object
            `body`: `Body` of the table. `body_for(density)`: the body for another density of the
            liquid. `result(levels_m)`: results at the rows of the table, with the name of the
            method as `surveyed_as`. `correction(corrections, gross_m3, top_m3)`: `Correction` of
            the volume at the top row, or None.
        """
        raise NotImplementedError

    def input_values(self, job):
        """Declared values of inputs that only this method has: {name: value}; None: no value."""
        return {}

    def undeclared(self, job, survey):
        """Inputs without a standard uncertainty that affect only `correction_tables`."""
        return ()

    def correction_tables(self, job, survey, body, table, progress):
        """`Result.ship`, corrections of readings of the table; None: none are needed.

        Parameters
        ----------
        job : Job
        survey : object
            Survey that `find` returned.
        body : Body
        table : Capacity
        progress : callable or None
            Called as progress(text, done, total).
        """

    def warnings(self, job, survey, sights=None):
        """`Problem`s of a survey: undetermined quantities, outliers, disagreement.

        Parameters
        ----------
        job : Job
        survey : object
            Survey that `find` returned; of a method with sights, the wall fitted to their points;
            of a supplement, its result.
        sights : object, optional
            Sights that `find` returned.

        Returns
        -------
        iterable of Problem
        """
        return ()

    # ---- record

    def is_saved(self, result):
        """Whether the record of a `Result` has a saved part of this method."""
        return self.name in result.surveys or self.name in result.sights

    def save(self, result):
        """Saved part of a `Result` whose surveys or sights contain this method."""
        raise NotImplementedError

    def zero(self, job):
        """Code of the zero of the heights of the table; None: the dip plate or the bottom."""

    def choices(self, result):
        """Assumptions of the method: {code: value} of `record.table.Choice`."""
        return {}

    def sizes(self, result):
        """Sizes of a tank of a single solid, as surveyed: {name: (value, unit)}."""
        return {}

    # ---- report

    def report_tables(self):
        """Module with the `report.tables.Table`s of the method.

        The cells of the report's notebook import it as `from tankcal.report.tables import NAME`.
        """
        raise AttributeError(f"the method {self.name} has no tables of the report")

    def report_figures(self):
        """Module with facts, sentences and figures of the reports.

        The cells of the report's notebook import it as `from tankcal.report import NAME`.
        """
        raise AttributeError(f"the method {self.name} has no figures of the report")

    def facts(self):
        """`Column`s of facts of the survey, for certificate and workbook."""
        return ()

    def unchecked(self, paper):
        """Sentences of the certificate on errors that the survey would not show."""
        return []

    def field_blocks(self, paper, texts):
        """Blocks of the field sheets before the forms of its tables."""
        return []

    def field_columns(self, paper, columns):
        """Columns (heading, unit, relative width) of the form of its first table."""
        return columns

    def csv_tables(self, record):
        """Tables that are also written as CSV files: {name of the file without .csv: Table}."""
        return {}

    def sheets(self, record):
        """Sheets of the workbook for a record with the saved part of this method.

        Returns
        -------
        list of (str, str, list of (str, Table))
            Name of the sheet, key of its subtitle in `[texts]` of the words, and its tables, each
            with the key of its heading in `[headings]`, which is also its name in the workbook.
        """
        return []

    def certificates(self, saved):
        """Instruments of the saved part and their certificates: {name: certificate or None}."""
        return {}


@cache
def methods():
    """All methods, each once: the methods of tankcal, then those of other distributions."""
    paths = (*_BUILT_IN, *find_entry_points(GROUP).values())
    return tuple(_load(path)() for path in paths)


def methods_for(kind):
    """Methods for a kind of tank; none for an unknown kind."""
    return tuple(method for method in methods() if kind in method.kinds)


def find_method(name):
    """Method with a name; None if no method has it."""
    return next((method for method in methods() if method.name == name), None)


def method_of(survey):
    """Method that found a survey; None for another survey, or without a survey."""
    return find_method(getattr(survey, "surveyed_as", None))


def with_readings(job, readings):
    """`Job` with other readings of some methods: {method: its readings}."""
    from dataclasses import replace  # not loaded by the command line

    attributes = {method.attribute: new for method, new in readings.items() if method.attribute}
    others = {method.name: new for method, new in readings.items() if not method.attribute}
    return replace(job, surveys=job.surveys | others, **attributes)


def given_methods(job):
    """Methods whose readings a `Job` contains."""
    return tuple(method for method in methods() if method.readings_of(job) is not None)


def count_readings(job):
    """Readings of the wall of a `Job` by kind and course: {kind: {course: count}}."""
    return {
        method.kind_of_readings: Counter(method.courses_of_readings(job))
        for method in given_methods(job)
        if method.kind_of_readings
    }


def supplement_of(job):
    """Given method that supplements the survey of a `Job`; None without one."""
    return next((method for method in given_methods(job) if method.is_supplement), None)


def accompanying_methods(job):
    """Methods of a `Job` whose readings may be joined with points of its wall."""
    return tuple(method for method in given_methods(job) if method.accompanies_points)


def is_size_measured(job):
    """Whether readings of a `Job` determine its size without distances of instruments."""
    return any(method.measures_size for method in given_methods(job))


def is_sighted(job):
    """Whether the points of the wall of a `Job` are single sights of a method."""
    return any(method.has_named_points for method in given_methods(job))


def completing_method(job):
    """Method that supplies the courses of a `Job` that its survey does not measure; or None."""
    return next((method for method in given_methods(job) if method.completes_survey), None)


def _load(path):
    """Module, or the object "module:name"."""
    module, _, name = path.partition(":")
    loaded = import_module(module)
    return getattr(loaded, name) if name else loaded
