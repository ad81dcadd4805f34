"""Products whose packages are outside `products/`: their commands, documents and saved formats."""

from tankcal.products.base import Product


class MainJob(Product):
    """From a job to its results."""

    name = "main job"
    commands = (
        ("run", "tankcal.cli.running"),
        ("demo", "tankcal.cli.running"),
        ("report", "tankcal.cli.reporting"),
        ("new", "tankcal.cli.starting"),
        ("verify", "tankcal.cli.verifying"),
    )

    def completions(self):
        from tankcal.text.shipped import LANGUAGES

        return {
            ("report", "--language"): (LANGUAGES, False),
            ("run", "--cluster"): (("auto", "local"), False),
        }

    def saved_types(self):
        from tankcal.record import making, versions

        return ((versions.RECORD, None, making.Record),)


class Batch(Product):
    """Many jobs."""

    name = "batch"
    commands = (("batch", "tankcal.cli.batching"),)

    def completions(self):
        exports, inspection, tables = Exports(), Inspection(), FormerTables()
        return {
            ("batch", "--profile"): exports.completions()["export", "--profile"],
            ("batch", "--inspect-by"): inspection.completions()["inspect", "--rule"],
            ("batch", "--compare-by"): tables.completions()["compare", "--rule"],
        }


class Workbench(Product):
    """A job in a notebook or a web page."""

    name = "workbench"
    commands = (("notebook", "tankcal.cli.workbench"), ("app", "tankcal.cli.workbench"))


class FieldBooks(Product):
    """Files of instruments."""

    name = "fieldbooks"
    commands = (("import", "tankcal.cli.importing"),)


class Planning(Product):
    """Uncertainty of a survey before its measurement."""

    name = "planning"
    commands = (("plan", "tankcal.cli.planning"),)

    def saved_types(self):
        from tankcal.record import plan

        return (plan.PLAN, None, plan.PlanFile), (plan.WALL_PLAN, None, plan.WallPlanFile)


class Linter(Product):
    """Errors in capacity tables of any origin."""

    name = "linter"
    commands = (("lint", "tankcal.cli.linting"),)


class FormerTables(Product):
    """Former tables of a tank: geometry, comparison, history."""

    name = "former tables"
    commands = (
        ("read-table", "tankcal.cli.table_reading"),
        ("compare", "tankcal.cli.comparing"),
        ("history", "tankcal.cli.history"),
    )

    def completions(self):
        from tankcal.job import rule_files

        return {("compare", "--rule"): (rule_files.shipped_names(), True)}

    def documents(self):
        from tankcal.report import comparison, history

        return comparison.DOCUMENT, history.DOCUMENT

    def saved_types(self):
        from tankcal.record import comparison, history

        return (
            (comparison.COMPARISON, None, comparison.ComparisonFile),
            (history.HISTORY, None, history.HistoryFile),
        )


class Exports(Product):
    """Capacity tables for gauging systems."""

    name = "exports"
    commands = (("export", "tankcal.cli.exporting"), ("chart", "tankcal.cli.charting"))

    def completions(self):
        from tankcal.exports.profiles import shipped_profiles

        return {("export", "--profile"): (tuple(shipped_profiles()), True)}


class Inspection(Product):
    """Condition of a tank from the survey of its calibration."""

    name = "inspection"
    commands = (("inspect", "tankcal.cli.inspecting"),)

    def completions(self):
        from tankcal.inspection import rules

        return {("inspect", "--rule"): (rules.shipped_names(), True)}

    def documents(self):
        from tankcal.report import inspection

        return (inspection.DOCUMENT,)

    def saved_types(self):
        from tankcal.record import inspection

        return ((inspection.INSPECTION, None, inspection.InspectionFile),)


class Cameras(Product):
    """Calibration of cameras."""

    name = "cameras"
    commands = (("camera", "tankcal.cli.camera"),)

    def completions(self):
        from tankcal.camera.formats.writing import KINDS

        return {
            ("camera convert", "--to"): (KINDS, False),
            ("camera convert", "--from"): (KINDS, False),
        }

    def saved_types(self):
        from tankcal.record import (
            camera_influence,
            camera_parameters,
            camera_product,
            camera_stability,
        )
        from tankcal.record.camera_versions import CAMERA

        return (
            (CAMERA, "stability", camera_stability.StabilityFile),
            (CAMERA, "parameters", camera_parameters.ParametersFile),
            (CAMERA, "influence", camera_influence.InfluenceFile),
            (CAMERA, "product", camera_product.ProductFile),
        )


class Intercomparison(Product):
    """Comparison of programs by simulated tanks."""

    name = "intercomparison"
    commands = (("intercomparison", "tankcal.cli.intercomparison"),)

    def saved_types(self):
        from tankcal.record import intercomparison as saved

        return (
            (saved.PACKAGE, None, saved.PackageFile),
            (saved.TRUTH, None, saved.TruthFile),
            (saved.ANSWERS, None, saved.AnswersFile),
            (saved.SCORES, None, saved.ScoresFile),
        )


class Help(Product):
    """Documentation, and completion in a shell."""

    name = "help"
    commands = (("docs", "tankcal.cli.pages"), ("completion", "tankcal.cli.completing"))

    def completions(self):
        from tankcal.text.shipped import page_names

        return {("docs", "page"): (page_names(), False)}
