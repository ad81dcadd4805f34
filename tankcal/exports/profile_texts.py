"""Texts of the shipped profiles as Messages, for translation."""

from tankcal.messages import message

_TEXTS = (
    message(
        "profile_typed",
        "Values are typed in, so that unit, decimals and marks are free: set those of the gauge's "
        "display",
    ),
    message(
        "profile_typed_claim",
        "Values are typed in, so that unit, decimals and marks are free: set those of the gauge's "
        "display; its claim of 0.1 % does not hold for a lying tank",
    ),
    message(
        "profile_typed_linear",
        "Values are typed in, so that unit, decimals and marks are free: set those of the gauge's "
        "display; for Universal Linear, what Universal Curved does was not found",
    ),
    message(
        "profile_typed_offsets",
        "Values are typed in, so that unit, decimals and marks are free: set those of the gauge's "
        "display; copy the profile to set the offsets, and give --points",
    ),
    message(
        "profile_typed_limit",
        "Values are typed in, so that unit, decimals and marks are free: set those of the gauge's "
        "display; give --points, the limit was not found",
    ),
    message(
        "profile_typed_spline",
        "Values are typed in, so that unit, decimals and marks are free: set those of the gauge's "
        "display; give --points, the limit was not found. Taken as a natural cubic spline: the end "
        "condition was not found",
    ),
    message("profile_litres", "Unit of volumes is assumed to be the litre"),
    message("profile_layout", "Layout of the file is assumed"),
    message(
        "profile_layout_initial",
        "Layout of the file is assumed; the first row is the initial volume",
    ),
    message(
        "profile_units_assumed",
        "Units and marks are assumed; dV is the volume since the row before",
    ),
    message(
        "profile_columns_assumed",
        "The order of the columns and the headings are assumed: compare with an export of your "
        "system",
    ),
    message("profile_every_row", "Every row, decimal point, comma"),
    message("profile_unchecked", "Not checked with its manual"),
    message("profile_any", "any program that reads CSV"),
    message("profile_russian", "a Russian level meter"),
    message("profile_aveva_centimetres", "AVEVA (increments of 1/100 m)"),
    message("profile_aveva_sixteenths", "AVEVA (increments of 1/16 in)"),
    message("profile_jde_increments", "Oracle JD Edwards (volume for each increment)"),
    message("profile_jde", "Oracle JD Edwards (height and volume)"),
    message("profile_siemens_spline", "Siemens LUT400, HydroRanger (cubic spline)"),
    message("profile_siemens_linear", "Siemens LUT400, HydroRanger (linear)"),
    message("profile_tls", "Veeder-Root TLS (20 points)"),
    message("profile_arts", "ARTS retail data model"),
    message("profile_own_choice", "own choice of tankcal"),
    message("profile_from_memory", "from memory: 1, 4 or 20 points"),
)
_KNOWN = {str(text): text for text in _TEXTS}


def as_message(text):
    """Return a text of a shipped profile as a Message; any other text unchanged."""
    return _KNOWN.get(text, text)
