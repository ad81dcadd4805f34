"""The versions of plan.json: so far one."""

from tankcal.record.saved_formats import SavedFormat

VERSION = 1
PLAN = SavedFormat("tankcal-plan", VERSION, "plan.json")
