"""Fields of plan.toml in one line each."""

from tankcal.job.fields import Field
from tankcal.messages import message


class Count(Field):
    """A whole number."""

    def _expected_number(self):
        return message("a_whole_number", "a whole number{bounds}", bounds=self._bounds())


def number(name, note, low=-1e5, high=1e5, required=False, above_low=False, choices=()):
    return Field(
        name, "number", note, required, low=low, high=high, above_low=above_low, choices=choices
    )


def count(name, note, required=False, high=500):
    return Count(name, "number", note, required, low=1, high=high)


def numbers_list(name, note, low, high, required=False):
    return Field(name, "numbers", note, required, low=low, high=high)
