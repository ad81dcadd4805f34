"""Short text and HTML representations of results in notebooks."""

from html import escape

from tankcal.text.digits import ENGLISH, NOTHING, fixed, format_with_u


def volume_text(volume_m3: float, U_m3: float, k: float | None = None) -> str:
    """Format a volume with its expanded uncertainty, both rounded to the digits of U.

    Parameters
    ----------
    volume_m3, U_m3 : float
        Volume and expanded uncertainty, m3.
    k : float, optional
        Coverage factor. None if U results from Monte Carlo and not from k u.

    Examples
    --------
    >>> volume_text(554.5601, 0.4212, 1.974)
    '554.56 m3, U = 0.42 m3 (k = 1.97)'
    >>> volume_text(554.5601, 0.4212)
    '554.56 m3, U = 0.42 m3 (Monte Carlo)'
    """
    how = "Monte Carlo" if k is None else f"k = {fixed(k, 2)}"
    if not U_m3 > 0:
        return f"{fixed(volume_m3, 3)} m3, no uncertainty declared"
    shown = format_with_u(volume_m3, U_m3, ENGLISH, least=0)
    return f"{shown.value}{shown.power} m3, U = {shown.uncertainty}{shown.power} m3 ({how})"


def table_html(caption: str, headings, rows) -> str:
    """Return a small HTML table; texts are escaped, numbers are right-aligned.

    Examples
    --------
    >>> "<td>2 &lt; 3</td>" in table_html("Rows", ["a"], [["2 < 3"]])
    True
    """
    head = "".join(f"<th>{escape(str(heading))}</th>" for heading in headings)
    body = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in rows)
    return (
        f"<table><caption>{escape(caption)}</caption>"
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    )


def _cell(value):
    """Return one HTML cell."""
    if value is None:
        return f"<td>{NOTHING}</td>"
    if isinstance(value, str):
        return f"<td>{escape(value)}</td>"
    return f'<td style="text-align:right">{value:g}</td>'
