"""Interactive elements of the web page: dip calculator, views of the tank and its wall.

The scripts in report_templates/web/ operate the elements, which are hidden without scripts.
"""

from html import escape

from tankcal.report.web.packing import script_data


def calculator_html(block, words):
    """Return the dip calculator: volume of a dip, and volume between two dips."""
    data = {key: block[key] for key in block if key not in ("kind", "text", "id")}
    fields = "".join(
        f'<p><label for="{name}">{escape(words[name])}</label> '
        f'<input id="{name}" inputmode="decimal" autocomplete="off" size="9" '
        f'aria-describedby="{name}-unit"> <span id="{name}-unit">m</span></p>'
        for name in ("dip", "other_dip")
    )
    results = "".join(
        f'<section aria-labelledby="{name}-label"><h4 id="{name}-label">'
        f"{escape(words[f'{name}_heading'])}</h4>"
        f'<p class="answer" id="{name}" role="status"></p><dl id="{name}-more"></dl></section>'
        for name in ("volume", "delivery")
    )
    return (
        f'<section class="widget" id="calculator" hidden>'
        f'<h3 id="{block["id"]}">{escape(words["calculator"])}</h3>'
        f'<div class="fields">{fields}</div><div class="answers">{results}</div>'
        f'<p class="note">{escape(words["calculator_note"])}</p>'
        f"{_data('calculator', data)}</section>"
    )


def view_html(block, words):
    """Return the three-dimensional view of the tank, or the reason why it is missing."""
    heading = f'<h2 id="{block["id"]}">{escape(words["view"])}</h2>'
    if block["reason"]:
        return f'<section class="widget">{heading}<p>{escape(block["reason"])}</p></section>'
    has_shell = block["shell"] is not None
    data = {key: block[key] for key in ("shell", "solid")}
    return (
        f'<section class="widget" id="view" hidden>{heading}'
        f"<p>{escape(words['view_shell' if has_shell else 'view_solid'])}</p>"
        f"{_view_controls(words) if has_shell else ''}"
        '<div class="stage"><canvas tabindex="0" role="img" '
        f'aria-label="{escape(words["view_alt"])}"></canvas><div class="marks" aria-hidden="true">'
        f'</div></div><p class="fallback" hidden>{escape(words["no_webgl"])}</p>'
        f'<p class="camera">{_buttons(words)}</p>'
        f'<p class="note">{escape(words["view_keys"])}</p>'
        f"{_data('tank', data)}</section>"
    )


def map_html(block, words):
    """Return the map of the unrolled wall, whose cells show their deviation."""
    data = {key: block[key] for key in block if key not in ("kind", "text", "id")}
    return (
        f'<section class="widget" id="map" hidden><h3 id="{block["id"]}">'
        f"{escape(words['cloud_map'])}</h3><p>{escape(words['cloud_map_text'])}</p>"
        '<div class="fields"><p>'
        f'<label for="map-limit">{escape(words["cloud_limit"])}</label> '
        '<input type="range" id="map-limit" min="0" max="100" value="50"> '
        '<output for="map-limit" id="map-full"></output></p></div>'
        '<canvas class="map" tabindex="0" role="img" '
        f'aria-label="{escape(words["cloud_map_alt"])}"></canvas>'
        '<p class="answer" id="map-told" role="status">\u00a0</p>'
        f"{_data('map', data)}</section>"
    )


def wall_html(block, words):
    """Return the unrolled wall with used and rejected points, and details of a selected point."""
    data = {key: block[key] for key in block if key not in ("kind", "text", "id")}
    return (
        f'<section class="widget" id="wall" hidden><h3 id="{block["id"]}">'
        f"{escape(words['wall_map'])}</h3><p>{escape(words['wall_map_text'])}</p>"
        '<canvas class="map" tabindex="0" role="img" '
        f'aria-label="{escape(words["wall_map_alt"])}"></canvas>'
        '<p class="answer" id="wall-told" role="status">\u00a0</p>'
        f"{_data('wall', data)}</section>"
    )


def _view_controls(words):
    choices = "".join(
        f'<option value="{value}">{escape(words[f"from_{value}"])}</option>'
        for value in ("circles", "cylinder")
    )
    return (
        '<div class="fields">'
        f'<p><label for="deviations">{escape(words["deviations"])}</label> '
        f'<select id="deviations">{choices}</select></p>'
        f'<p><label for="exaggeration">{escape(words["exaggeration"])}</label> '
        '<input type="range" id="exaggeration" min="0" max="100"> '
        '<output for="exaggeration" id="factor"></output></p>'
        f'<p><label><input type="checkbox" id="show-points" checked> '
        f"{escape(words['show_points'])}</label></p>"
        f'<p><label><input type="checkbox" id="show-names"> {escape(words["show_names"])}</label>'
        '</p></div><div class="legend"><span id="least"></span><span class="ramp"></span>'
        f'<span id="most"></span> <span>{escape(words["legend"])}</span></div>'
    )


def _buttons(words):
    signs = {"left": "◀", "right": "▶", "up": "▲", "down": "▼", "nearer": "+", "farther": "−"}
    buttons = [
        f'<button type="button" data-move="{move}" aria-label="{escape(words[move])}" '
        f'title="{escape(words[move])}">{sign}</button>'
        for move, sign in signs.items()
    ]
    buttons.append(f'<button type="button" data-move="reset">{escape(words["reset"])}</button>')
    return " ".join(buttons)


def _data(name, data):
    return f'<script type="application/json" id="{name}-data">{script_data(data)}</script>'
