"""Compare a prediction with the limit of its plan."""

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.pipeline.statements import MINIMA_M


def limited_u(tabled, limits):
    """U over volume of the full tank, or of the worst delivery of the smallest minimum."""
    if limits.of == "delivery":
        return float(tabled.stated.worst[0].relative.relative)
    table = tabled.made.table
    return float(table.U_m3[-1] / table.volume_m3[-1])


class OfTable:
    """Mixin: properties of a prediction from its table (`tabled`) and its plan (`plan`)."""

    @property
    def table(self):
        """Capacity table with U of every row (`capacity.Capacity`)."""
        return self.tabled.made.table

    @property
    def relative_u(self):
        """U over volume of the limited quantity: the full tank or the worst delivery."""
        return limited_u(self.tabled, self.plan.limits)

    @property
    def meets(self):
        """Whether the limit is met; None if the plan has no limit."""
        limit = self.plan.limits.relative_u
        return None if limit is None else bool(self.relative_u <= limit)


def refuse_without_delivery(plan, tabled, tall):
    """Raise InputError if the limit is for deliveries and no delivery of the table is long enough.

    tall: height of the shell, m.
    """
    if plan.limits.of == "delivery" and not tabled.stated.worst:
        least = min(plan.job.table.minimum_delivery_m or MINIMA_M)
        file, row, name = plan.limits.place
        expected = message(
            "plan_no_delivery",
            "no delivery of {least:g} m or more in a shell of {tall:g} m; expected "
            "top, or a smaller table.minimum_delivery_m",
            least=least,
            tall=tall,
        )
        raise InputError(Problem(file, expected, row, name))
