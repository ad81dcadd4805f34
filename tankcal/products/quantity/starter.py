"""An empty ticket.toml for the tank of a record, with explanatory comments."""

from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.quantity.chain import STATES
from tankcal.products.quantity.reading import SECTIONS
from tankcal.tank.gauging import ASSUMPTIONS
from tankcal.text.words import load_words

FORM = ("ticket", "product", *STATES, "compared", "shell", "uncertainty")  # order of the sections
TO_FILL_IN = {  # keys that every ticket needs, besides those that are required
    "ticket": ("number", "date"),
    "product": ("density_kg_m3", "base", "group"),
    "closing": ("dip_m", "temperature_c", "ambient_c"),
}


def starter_text(table, language, file):
    """Return the text of an empty ticket.toml.

    Parameters
    ----------
    table : TankTable
    language : str
        As in languages.LANGUAGES.
    file : str
        Name of the file, for the comment on the next command.

    Returns
    -------
    str
    """
    words = load_words(language)
    form, notes = words["ticket"]["form"], words["ticket"]["notes"]
    values = {
        "expansion": f"{table.expansion_per_k:g}",
        "reference": f"{table.reference_height_m:g}" if table.reference_height_m else "",
    }
    lines = [f"# {form['title'].format(tank=table.tank)}", f"# {form['then'].format(file=file)}"]
    for section in FORM:
        lines += ["", f"# {form[f'sections_{section}']}", f"[{section}]"]
        for field in SECTIONS[section]:
            if field.name == "ullage_m" and not table.reference_height_m:
                continue
            note = notes["gauging" if section in STATES else section][field.name].format(**values)
            if field.choices:
                choices = form["one_of"].format(choices=", ".join(field.choices))
                note = f"{note}; {choices}"
            if section == "uncertainty":
                note = f"{note}; {_assumption(form, field.name)}"
            if field.required or field.name in TO_FILL_IN.get(section, ()):
                note = f"{form['fill_in']}: {note}"
            lines.append(f"{field.name + ' = ' + chr(34) * 2:<28} # {note}")
    return "\n".join(lines) + "\n"


def _assumption(form, name):
    """Note on the value of a blank uncertainty, with a decimal point as in the file."""
    value, origin = ASSUMPTIONS[name]
    if value is None:
        return form["rule"]
    return form[origin].format(value=f"{value:g}")


def write_starter(path, table, language):
    """Write an empty ticket.toml.

    Parameters
    ----------
    path : Path
        A new file.
    table : TankTable
    language : str

    Raises
    ------
    InputError
        If the file exists, or its name does not end in .toml.
    OSError
    """
    path = Path(path)
    if path.suffix.lower() != ".toml":
        expected = message("ticket_new_name", "expected the name of a new .toml file")
        raise InputError(Problem(str(path), expected))
    if path.exists():
        expected = message(
            "ticket_new_exists", "exists, and is left unchanged; expected the name of a new file"
        )
        raise InputError(Problem(str(path), expected))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(starter_text(table, language, path.name), encoding="utf-8")
