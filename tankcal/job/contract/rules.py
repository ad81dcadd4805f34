"""The keys of a decision rule's file: [rule], [uncertainty.NAME] and [deviation.NAME]."""

from tankcal.job.fields import Field
from tankcal.tank.rules.model import DEVIATION_OF, GUARDS, RELATIVE_TO, SIDES, UNCERTAINTY_OF

RULE = (
    Field("name", "text", "name of the rule", required=True),
    Field("source", "text", "where its values were read", required=True),
    Field("verified", "flag", "whether they were read in the legal or technical text itself"),
    Field("remark", "text", "anything that is to stand beside it"),
    Field(
        "largest_capacity_m3", "number", "largest tank it is for", low=0, above_low=True, high=1e9
    ),
)
_SHARED = (
    Field("tanks", "names", "kinds of tank that it is for"),
    Field("clause", "text", "where it stands in the text"),
    Field("verified", "flag", "whether it was read in the legal or technical text itself"),
)
_PERCENT = Field("limit_percent", "number", "limit in percent", low=0, above_low=True, high=100)
LIMITS = {
    "uncertainty": (
        Field("of", "choice", "what is limited", required=True, choices=UNCERTAINTY_OF),
        _PERCENT,
        Field("relative_to", "choice", "what the limit is a part of", choices=RELATIVE_TO),
        Field(
            "minimum_height_m",
            "number",
            "least height of a delivery",
            low=0,
            above_low=True,
            high=100,
        ),
        *_SHARED,
    ),
    "deviation": (
        Field("of", "choice", "what is limited", required=True, choices=DEVIATION_OF),
        _PERCENT,
        Field("limit_m3", "number", "limit as a volume", low=0, above_low=True, high=1e9),
        Field("side", "choice", "which deviations are limited", choices=SIDES),
        Field("guard", "choice", "width of the guard band", required=True, choices=GUARDS),
        *_SHARED,
    ),
}
