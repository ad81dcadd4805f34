"""Short definitions of the fields of plan.toml, and checks shared by several sections."""

from tankcal.job.fields import Field
from tankcal.messages import message


class Count(Field):
    """Field of a whole number."""

    def _expected_number(self):
        return message("a_whole_number", "a whole number{bounds}", bounds=self._bounds())


def number(name, note, low=-1e5, high=1e5, required=False, above_low=False, choices=()):
    """Return a Field of a number between `low` and `high`."""
    return Field(
        name, "number", note, required, low=low, high=high, above_low=above_low, choices=choices
    )


def count(name, note, required=False, high=500):
    """Return a Field of a whole number from 1 to `high`."""
    return Count(name, "number", note, required, low=1, high=high)


def numbers_list(name, note, low, high, required=False):
    """Return a Field of a list of numbers between `low` and `high`."""
    return Field(name, "numbers", note, required, low=low, high=high)


def no_such_name(found, file, hint=""):
    """Return the message about a name that a file does not define."""
    return message(
        "plan_no_such_name",
        "found {found!r}; expected a name of {file}{hint}",
        found=found,
        file=file,
        hint=hint,
    )


def too_many_sections(count, most):
    """Return the message about too many sections of one kind."""
    return message(
        "plan_many_sections", "{count} of them; expected at most {most}", count=count, most=most
    )


def check_form(section, log):
    """Check that the common ovality of the shell does not exceed the ovality of a course."""
    whole, common = section["form_mm"] or 0.0, section["common_form_mm"] or 0.0
    if common > whole and not section.is_refused("form_mm"):
        expected = message(
            "plan_form_part",
            "found {common:g}, which is a part of form_mm; expected at most {whole:g}",
            common=common,
            whole=whole,
        )
        section.tell(log.problem, "common_form_mm", expected)
