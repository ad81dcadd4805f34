"""Products whose packages are outside `products/`: their commands and saved formats."""

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


class Planning(Product):
    """Uncertainty of a survey before its measurement."""

    name = "planning"
    commands = (("plan", "tankcal.cli.planning"),)

    def saved_types(self):
        from tankcal.record import plan

        return (plan.PLAN, None, plan.PlanFile), (plan.WALL_PLAN, None, plan.WallPlanFile)


class Cameras(Product):
    """Calibration of cameras."""

    name = "cameras"
    commands = (("camera", "tankcal.cli.camera"),)

    def completions(self):
        from tankcal.camera.formats.reading import WRITING_KINDS

        return {
            ("camera convert", "--to"): (WRITING_KINDS, False),
            ("camera convert", "--from"): (WRITING_KINDS, False),
        }

    def saved_types(self):
        from tankcal.record import camera
        from tankcal.record.versions import CAMERA

        return (
            (CAMERA, "stability", camera.StabilityFile),
            (CAMERA, "parameters", camera.ParametersFile),
            (CAMERA, "influence", camera.InfluenceFile),
            (CAMERA, "product", camera.ProductFile),
        )


class Help(Product):
    """Documentation, and completion in a shell."""

    name = "help"
    commands = (("docs", "tankcal.cli.pages"), ("completion", "tankcal.cli.completing"))

    def completions(self):
        from tankcal.text.shipped import page_names

        return {("docs", "page"): (page_names(), False)}
