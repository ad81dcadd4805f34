"""Form of the settings of a job, from the contract: groups, labels, kinds of entry, choices."""

from dataclasses import dataclass
from enum import StrEnum

from tankcal.job.certificate_entries import missing_entries
from tankcal.job.contract import KEYS, OF_PHOTOS, SECTIONS
from tankcal.methods.base import methods
from tankcal.products.desk.display import MOST_CHOICES
from tankcal.products.desk.keys import READ_ONLY_SECTIONS, SETTINGS
from tankcal.products.desk.tables import text_for_display
from tankcal.text.naming import split_unit

# Settings that most jobs state although they are not required, {section: keys}.
USUAL_KEYS = {
    "tank": ("nominal_diameter_m", "nominal_height_m", "nominal_volume_m3"),
    "survey": ("shell_temperature_c", "liquid_level_m", "liquid_density_kg_m3", "pressure_bar"),
    "datum": ("bottom_z_m", "dip_plate_z_m", "dip_x_m", "dip_y_m", "reference_height_m"),
    "table": (
        *("step_m", "height_unit", "volume_unit", "liquid_density_kg_m3", "pressure_bar"),
        "language",
    ),
    "horizontal": (
        *("diameter_m", "end_a_depth_m", "end_b_depth_m", "tilt_mm_per_m", "thickness_mm"),
        "azimuth_deg",
    ),
    "sphere": ("diameter_m", "thickness_mm"),
    "shell": ("shape_sd_mm",),
}
# Settings of the tank that only the certificate prints; [certificate] belongs to them.
PRINTED_KEYS = (
    *("owner", "location", "product", "manufacturer", "year", "serial_number", "construction"),
    "remarks",
)


class Group(StrEnum):
    """Group of settings; the values are keys of the words."""

    NEEDED = "needed"
    CERTIFICATE = "certificate"
    EXPERT = "expert"


@dataclass(frozen=True)
class FormField:
    """A setting as an entry of a form.

    Attributes
    ----------
    section, key : str
        Its place in the settings.
    group : Group
        Group of the form.
    label, unit, help : str
        Short label, symbol of the unit, and explanation with the accepted values.
    entry : {"text", "number", "choice", "flag", "date"}
        Kind of entry.
    choices : tuple of (str, str)
        Codes and texts of a choice; usual values of a text.
    value : str
        Text with the decimal mark of the language.
    is_required : bool
        Whether the kind of tank requires it.
    is_asked : bool
        Whether ISO/IEC 17025 requires it on a certificate and it is blank.
    level, problem : str
        Level and text of its problem or warning; "" without any.
    """

    section: str
    key: str
    group: Group
    label: str
    unit: str = ""
    help: str = ""
    entry: str = "text"
    choices: tuple = ()
    value: str = ""
    is_required: bool = False
    is_asked: bool = False
    level: str = ""
    problem: str = ""

    @property
    def name(self):
        """Name of the entry: section and key."""
        return f"{self.section}.{self.key}"


def form_of(desk):
    """Build the form of the settings of a job.

    Returns
    -------
    list of FormField
        In the order of the contract, without the format of the files and without the settings of
        methods of which the job has neither a table nor a setting.
    """
    draft, reader = desk.draft, desk.reader
    if SETTINGS not in draft.keys:
        return []
    entries = {(entry.owner, entry.key): entry.text for entry in draft.keys[SETTINGS].entries}
    marks = reader.marks_of_keys(desk.outcome, SETTINGS)
    asked = _find_asked_entries(entries)
    fields = []
    for section in SECTIONS:
        if section in READ_ONLY_SECTIONS or not _is_used(section, draft, entries):
            continue
        for field in KEYS[section]:
            place = section, field.name
            if place not in entries and not _is_usable(field, draft):
                continue
            level, problem = marks.get(place, ("", ""))
            codes = ("true", "false") if field.kind == "flag" else field.choices
            codes = () if len(codes) > MOST_CHOICES else codes
            fields.append(
                FormField(
                    *place,
                    _group_of(section, field, draft.kind, level),
                    reader.label(section, field),
                    split_unit(field.name)[1],
                    reader.help(SETTINGS, section, field, not codes and field.kind != "date"),
                    _entry_of(field),
                    tuple((code, reader.choice(field, code)) for code in codes),
                    text_for_display(field, entries.get(place, ""), ".", reader.mark),
                    field.is_required(draft.kind),
                    place in asked,
                    level,
                    problem,
                )
            )
    return fields


def _find_asked_entries(entries):
    """Places of blank entries that ISO/IEC 17025 requires on a certificate."""
    stated = {key: text for (section, key), text in entries.items() if section == "certificate"}
    location = entries.get(("tank", "location"))
    certificate = {key: text for key, text in stated.items() if text.strip()}
    return {("certificate", str(key)) for key in missing_entries(certificate, location)}


def _is_usable(field, draft):
    """Whether a job of this kind of tank and survey may have a setting."""
    has_photos = "photos" in draft.tables
    has_network = has_photos or "setups" in draft.tables or "distances" in draft.tables
    is_of_photos = field.name in OF_PHOTOS and not has_photos
    return field.suits(draft.kind) and not is_of_photos and (has_network or not field.of_survey)


def _is_used(section, draft, entries):
    """Whether the job may use a section; a section of a method needs its tables or settings."""
    if section == "adjustment.camera":
        return "photos" in draft.tables
    owners = [method for method in methods() if section in method.settings()]
    if not owners:
        return True
    tables = {name for method in owners for name in method.columns()}
    is_stated = any(owner == section and text for (owner, _), text in entries.items())
    return is_stated or bool(tables & draft.tables.keys())


def _group_of(section, field, kind, level):
    """Group of a setting; a setting with a problem is needed."""
    if section == "certificate" or (section == "tank" and field.name in PRINTED_KEYS):
        return Group.CERTIFICATE
    if level == "bad" or field.is_required(kind) or field.name in USUAL_KEYS.get(section, ()):
        return Group.NEEDED
    return Group.EXPERT


def _entry_of(field):
    """Kind of entry of a field."""
    if field.kind == "choice" and len(field.choices) <= MOST_CHOICES:
        return "choice"
    if field.kind in ("flag", "date"):
        return field.kind
    return "number" if field.kind == "number" and not field.choices else "text"
