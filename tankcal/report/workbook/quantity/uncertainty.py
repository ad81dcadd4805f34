"""Formulas of U: derivatives of the quantities by each input, and their combination.

Own inputs of a gauging are independent; shared inputs act on the difference closing - opening with
the difference of both derivatives, and so do the columns of the covariance factor of the table.
"""

import math
from dataclasses import replace
from itertools import pairwise

from tankcal.report.uncertainty.stated import read_room_levels, roof_of
from tankcal.report.workbook.calculator.delivery import normal, student
from tankcal.report.workbook.calculator.table import factor_formula
from tankcal.report.workbook.quantity.correction import (
    NONE,
    STATES,
    TYPED,
    Cell,
    Row,
    cell_row,
    interpolation_formulas,
    state_row,
)
from tankcal.tank.fittings import AIR_KG_M3, WEIGHTS_KG_M3
from tankcal.tank.gauging import ROOMS, VCF_AT_K, VCF_K, VCF_PERCENT
from tankcal.uncertainty import least_of

QUANTITIES = ("tov", "gov", "gsv", "nsv", "mass", "weight")
OWN = ("dip", "water", "temperature", "interpolation")
SHARED = ("thermometer", "tape", "ambient", "density", "sw", "expansion", "vcf")
# Keys of the cells that state a value with U, and their symbols.
_STATEMENT = {"table": "u² (V)", "u": "u", "dof": "ν", "k": "k", "U": "U"}
_FILL_SYMBOLS = {"fill_cold": "h/s", "fill": "F", "fill_t": "∂F/∂TSh", "fill_a": "∂F/∂a"}
_INFINITE = "1E+99"  # replaces infinite degrees of freedom


def rows(table):
    """Rows of the derivatives of both gaugings, and of u, k and U of the difference."""
    interpolation = table.record.get("interpolation")
    largest_m3 = interpolation["largest_m3"] if interpolation else 0.0
    block = []
    for state in STATES:
        block += _derivatives(state, largest_m3)
    return [*_scale(), *block, *_table_rows(table), *_combination(table), *_rooms(table)]


def _scale():
    """Row of the relative standard uncertainty of VCF, as `Transfer._vcf_scale`."""
    distance, formula = "ABS([liquid@]-[t_b])", ""
    points = list(zip(VCF_AT_K.tolist(), VCF_PERCENT.tolist(), strict=True))
    for (low, low_u), (high, high_u) in reversed(list(pairwise(points))):
        line = f"{low_u!r}+({distance}-{low!r})*{high_u - low_u!r}/{high - low!r}"
        # The last slope goes on beyond the last point.
        formula = f"IF({distance}<{high!r},{line},{formula})" if formula else line
    rule = f"SIGN([liquid@]-[t_b])*({formula})/100/{VCF_K!r}"
    scale = f"IF(ISBLANK([u_vcf]),{rule},[u_vcf]/100)"
    return [state_row("scale", "u(VCF)/VCF", f"IF([state@]=#fine,{scale},0)", 0)]


def _derivatives(state, interpolation_m3):
    """Rows of the derivatives of a gauging: an input each, with u in the last column."""
    by_level = "[tov_slope@]*[ctsh@]+[net@]*[ctsh_h@]"
    by_shell = "[net@]*[ctsh_t@]"
    liquid_share = "IF([insulated_code]=1,1,7/8)"
    by_temperature = f"{by_shell}*{liquid_share}+[fra_rho@]*[rho_b]*[vcf_t@]"
    rho_slope, vcf_slope = "[rho_ratio]*[rho_b]/[density]", "[vcf_r@]/[density]"
    by_density = f"[fra_rho@]*({rho_slope}*[vcf@]+[rho_b]*{vcf_slope})"
    taped = "IF(ISBLANK([ullage@]),[level@],-[ullage@])"
    by_vcf = "[vcf@]*[scale@]"
    # {input: (dTOV, dGOV, dVCF, drho_base, dCSW, standard uncertainty)}
    parts = {
        "dip": ("[tov_slope@]", by_level, "0", "0", "0", "[u_dip]/1000"),
        "water": ("0", "-[has_water@]*[water_slope@]*[ctsh@]", "0", "0", "0", "[u_water]/1000"),
        "temperature": ("0", by_temperature, "[vcf_t@]", "0", "0", "[u_temperature]"),
        "interpolation": ("1", "[ctsh@]", "0", "0", "0", repr(interpolation_m3 / math.sqrt(3))),
        "thermometer": ("0", by_temperature, "[vcf_t@]", "0", "0", "[u_thermometer]"),
        "tape": (f"[tov_slope@]*{taped}", f"({by_level})*{taped}", "0", "0", "0", "[u_tape]/1E6"),
        "ambient": ("0", f"IF([insulated_code]=1,0,{by_shell}/8)", "0", "0", "0", "[u_ambient]"),
        "density": ("0", by_density, vcf_slope, rho_slope, "0", "[u_density]"),
        "sw": ("0", "0", "0", "0", "-1", "IF(ISBLANK([sw]),0,[u_sw]/100)"),
        "expansion": ("0", "[net@]*[ctsh_a@]", "0", "0", "0", "[u_expansion]"),
        "vcf": ("0", f"[fra_rho@]*[rho_b]*{by_vcf}", by_vcf, "0", "0", "1"),
    }  # fmt: skip
    per_density = f"(1-{AIR_KG_M3!r}/{WEIGHTS_KG_M3!r})"
    rows = []
    for name in (*OWN, *SHARED):
        key = f"{name}_{{}}@"
        gov, vcf, rho, csw, gsv, nsv = (
            f"[{key.format(part)}]" for part in ("gov", "v", "rho", "csw", "gsv", "nsv")
        )
        by_tov, by_gov, by_v, by_rho, by_csw, u = parts[name]
        cells = {
            "tov": by_tov,
            "gov": by_gov,
            "gsv": f"[vcf@]*{gov}+[gov@]*{vcf}",
            "nsv": f"[csw@]*{gsv}+[gsv@]*{csw}",
            "mass": f"[rho_b]*{nsv}+[nsv@]*{rho}",
            "weight": f"([rho_b]-{AIR_KG_M3!r})/{per_density}*{nsv}+[nsv@]*{rho}/{per_density}",
            "v": by_v,
            "rho": by_rho,
            "csw": by_csw,
            "u": u,
        }
        rows.append(Row("∂", tuple(
            Cell(f"{name}_{part}@", f"IF([state@]=#fine,{formula},0)", 0)
            for part, formula in cells.items()
        ), "interpolation" if name == "interpolation" else f"u_{name}"))  # fmt: skip
    return [_fill_state(row, state) for row in rows]


def _fill_state(row, state):
    """Row with the cells of a state in place of "@"."""
    cells = (
        Cell(cell.key.replace("@", f"_{state}"), cell.formula.replace("@", f"_{state}"),
             cell.result)
        for cell in row.cells
    )  # fmt: skip
    return replace(row, cells=tuple(cells))


def _table_rows(table):
    """Rows of degrees of freedom of the table at each dip, and the places in its factor."""
    formula = _dof_formula(table, "[tov_row@]")
    places = [
        state_row(f"use_{key}", "", f"IF([state@]=#fine,[{key}@],{blank})", blank)
        for key, blank in (
            ("tov_row", 1), ("tov_part", 0), ("water_row", 1), ("water_part", 0), ("has_water", 0),
        )
    ]  # fmt: skip
    return [*places, state_row("table_dof", "ν", f"IF([state@]=#fine,{formula},{_INFINITE})",
                               float(_INFINITE))]  # fmt: skip


def _dof_formula(table, row):
    """Formula of the degrees of freedom of the table above a row: the smaller of two rows."""
    groups = [group for group in table.groups() if math.isfinite(group.dof)]
    if not groups:
        return _INFINITE
    least = least_of([group.dof for group in groups])

    def dof(row):
        every = f"SUMSQ({factor_formula(row)})"
        fourth = "+".join(
            f"SUMSQ({factor_formula(row, group.first + 1, group.last + 1)})^2/{group.dof!r}"
            for group in groups
        )
        return f"IF({fourth}>0,MAX({every}^2/({fourth}),{least!r}),{_INFINITE})"

    return f"MIN({dof(row)},{dof(f'{row}+1')})"


def _factor(state, *, is_net):
    """Formula of the row of the covariance factor of TOV of a gauging, or of TOV - FW."""

    def at(key):
        low, high = (factor_formula(f"[use_{key}_row_{state}]{end}") for end in ("", "+1"))
        return f"({low}*(1-[use_{key}_part_{state}])+{high}*[use_{key}_part_{state}])"

    water = f"-[use_has_water_{state}]*{at('water')}" if is_net else ""
    return f"({at('tov')}{water})"


def _combination(table):
    """Rows of variance by the table, u, degrees of freedom, k and U, a column per quantity."""
    is_stock, good = "[level_state_o]=#opening_blank", "[state_c]=#fine"
    complete = f"AND({good},OR({is_stock},[state_o]=#fine))"
    probability = table.job["table"]["coverage_probability"]
    parts = {key: [] for key in _STATEMENT}
    has_roof = bool(table.record["roof"])
    for name in QUANTITIES:
        by_table = "0"
        if table.capacity["inputs"]:
            slopes = [f"[interpolation_{name}_{state}]" for state in STATES]
            factors = [_factor(state, is_net=name != "tov") for state in STATES]
            by_table = f"SUMPRODUCT(({slopes[1]}*{factors[1]}-{slopes[0]}*{factors[0]})^2)"
        independent = "+".join(
            f"SUMPRODUCT((([{OWN[0]}_{name}_{s}]:[{OWN[-1]}_{name}_{s}])"
            f"*([{OWN[0]}_u_{s}]:[{OWN[-1]}_u_{s}]))^2)"
            for s in STATES
        )
        shared = (
            f"SUMPRODUCT(((([{SHARED[0]}_{name}_c]:[{SHARED[-1]}_{name}_c])"
            f"-([{SHARED[0]}_{name}_o]:[{SHARED[-1]}_{name}_o]))"
            f"*([{SHARED[0]}_u_c]:[{SHARED[-1]}_u_c]))^2)"
        )
        # The uncertainty of a typed factor is not known, so U ends with the observed volume.
        is_open = name == "tov" or (name == "gov" and not has_roof)
        known = complete if is_open else f"AND({complete},[correction_code]<>{TYPED})"
        cells = _statement(name, known, by_table, f"{independent}+{shared}",
                           "MIN([table_dof_o],[table_dof_c])", probability)  # fmt: skip
        for key, cell in cells.items():
            parts[key].append(cell)
    differences = Row("Δ", tuple(
        Cell(f"moved_{name}",
             f"IF({complete},[{source}_c]-IF({is_stock},0,[{source}_o]),{NONE})")
        for name in QUANTITIES
        for source in ["tov_volume" if name == "tov" else name]
    ))  # fmt: skip
    return [differences, *(Row(_STATEMENT[key], tuple(cells)) for key, cells in parts.items())]


def _statement(name, known, by_table, by_others, dof_of_table, probability):
    """{key of _STATEMENT: cell} of a value, from the variances by the table and by other inputs."""
    variance, dof, z = f"[table_{name}]", f"[dof_{name}]", normal(probability)
    effective = f"IF({variance}>0,[u_{name}]^4/({variance}^2/{dof_of_table}),{_INFINITE})"
    formulas = {
        "table": by_table,
        "u": f"SQRT({variance}+{by_others})",
        "dof": effective,
        "k": f"IF({dof}>1E+15,{z},{student(probability, dof, z)})",
        "U": f"[k_{name}]*[u_{name}]",
    }
    return {
        key: Cell(f"{key}_{name}", f"IF({known},{formula},{NONE})")
        for key, formula in formulas.items()
    }


def _rooms(table):
    """Rows of the volumes from the closing gauging to the operating levels, a column each.

    F is the observed volume up to a level, P the present volume; see `Transfer.rooms`.
    """
    roof = roof_of(table.record) if table.record["roof"] else None
    columns = [
        [_fill_state(row, name) for row in _room_rows(table, name, dip, roof)]
        for name, dip in read_room_levels(table.record).items()
    ]
    return [
        replace(rows[0], cells=tuple(cell for row in rows for cell in row.cells))
        for rows in zip(*columns, strict=True)
    ]


def _room_rows(table, name, dip, roof):
    """Yield the rows of a room, from its level to U, with "@" in place of its name."""
    record, sign = table.record, ROOMS[name][1]
    interpolation = record.get("interpolation")
    u_line = interpolation["largest_m3"] / math.sqrt(3) if interpolation else 0.0
    # Below its critical zone the roof rests on its legs, and displaces no liquid.
    rests = 1 if roof and dip < roof["roof_critical_top"] else 0
    by_dip = "([tov_slope_c]*[ctsh_c]+[tov_volume_c]*[ctsh_h_c])"
    by_shell = "([fill_t@]-[tov_volume_c]*[ctsh_t_c])"
    share = "IF([insulated_code]=1,1,7/8)"
    by_temperature = f"({by_shell}*{share}-{rests}*[fra_rho_c]*[rho_b]*[vcf_t_c])"
    rho_slope, vcf_slope = "[rho_ratio]*[rho_b]/[density]", "[vcf_r_c]/[density]"
    by_density = f"[fra_rho_c]*({rho_slope}*[vcf_c]+[rho_b]*{vcf_slope})"
    taped = "IF(ISBLANK([ullage_c]),[level_c],-[ullage_c])"
    contributions = {
        "dip": f"{by_dip}*[u_dip]/1000",
        "tape": f"{by_dip}*{taped}*[u_tape]/1E6",
        "temperature": f"{by_temperature}*[u_temperature]",
        "thermometer": f"{by_temperature}*[u_thermometer]",
        "ambient": f"IF([insulated_code]=1,0,{by_shell}/8)*[u_ambient]",
        "expansion": "([fill_a@]-[tov_volume_c]*[ctsh_a_c])*[u_expansion]",
        "density": f"{rests}*{by_density}*[u_density]",
        "vcf": f"{rests}*[fra_rho_c]*[rho_b]*[vcf_c]*[scale_c]",
        # The lines between rows at the dip and at the level have independent errors.
        "interpolation": f"[ctsh_c]*{u_line * math.sqrt(2)!r}",
    }
    # U of a typed factor is not known; it acts on a roof that rests at the level only.
    known = f"AND([state_c]=#fine,[correction_code]<>{TYPED})" if rests else "[state_c]=#fine"
    present = "([tov_volume_c]*[ctsh_c]+[fra_c])"
    value = f"{sign}*([fill@]+(1-{rests})*[fra_c]-{present})"
    by_table = "0"
    if table.capacity["inputs"]:
        low, high = (factor_formula(f"[fill_row@]{end}") for end in ("", "+1"))
        there = f"({low}*(1-[fill_part@])+{high}*[fill_part@])"
        by_table = f"[ctsh_c]^2*SUMPRODUCT(({there}-{_factor('c', is_net=False)})^2)"
    names = list(contributions)
    independent = f"SUMSQ([by_{names[0]}@]:[by_{names[-1]}@])"
    statement = _statement(
        name, known, by_table, independent, "MIN([table_dof_c],[fill_dof@])",
        record["job"]["table"]["coverage_probability"],
    )  # fmt: skip
    yield cell_row("fill_level@", "h", repr(dip), dip)
    for part, formula in interpolation_formulas("fill", "[fill_level@]").items():
        yield cell_row(f"fill_{part}@", "V" if part == "volume" else "", formula, 0)
    for key, formula in _fill_formulas(record).items():
        symbol = _FILL_SYMBOLS.get(key, "")
        yield cell_row(f"{key}@", symbol, f"IF([state_c]=#fine,{formula},{NONE})")
    yield cell_row("fill_dof@", "ν", _dof_formula(table, "[fill_row@]"), 0)
    yield cell_row("room@", "F - P", f"IF([state_c]=#fine,{value},{NONE})")
    for key, formula in contributions.items():
        cell = Cell(f"by_{key}@", f"IF([state_c]=#fine,{formula},0)", 0)
        yield Row("u", (cell,), key if key == "interpolation" else f"u_{key}")
    for key, cell in statement.items():
        yield Row(_STATEMENT[key], (cell,))


def _fill_formulas(record):
    """{key: formula} of F, and of its derivatives by the temperature and expansion of the shell."""
    a = record["job"]["material"]["expansion_per_k"]
    if record["job"]["tank"]["kind"] == "vertical":
        return {
            "fill": "[fill_volume@]*[ctsh_c]",
            "fill_t": "[fill_volume@]*[ctsh_t_c]",
            "fill_a": "[fill_volume@]*[ctsh_a_c]",
        }
    # F = s^3 V(h / s), heights above the bottom; see `gauging`.
    zero = record["capacity"]["zero_m"]
    warming = f"([shell_c]-{record['job']['table']['reference_temperature_c']!r})"
    height = f"([fill_level@]+{zero!r})"
    by_s = f"(3*[s_c]^2*[fill_cold_volume@]-[s_c]*[fill_cold_slope@]*{height})"
    return {
        "fill_cold": f"{height}/[s_c]-{zero!r}",
        **{
            f"fill_cold_{part}": formula
            for part, formula in interpolation_formulas("fill_cold", "[fill_cold@]").items()
        },
        "fill": "[s_c]^3*[fill_cold_volume@]",
        "fill_t": f"{a!r}*{by_s}",
        "fill_a": f"{warming}*{by_s}",
    }
