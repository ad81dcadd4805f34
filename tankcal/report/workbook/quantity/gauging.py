"""Formulas of each gauging: volumes of the table, shell, roof and the steps to the quantities."""

from dataclasses import replace

from tankcal.report.uncertainty.sources import is_roof_in_table, roof_of
from tankcal.report.workbook.quantity.correction import (
    FACTORS,
    NONE,
    TYPED,
    factor_rows,
    fault,
    first_true,
    state_row,
)
from tankcal.tank.fittings import AIR_KG_M3, WEIGHTS_KG_M3
from tankcal.tank.gauging import LIMITS

BLANK = ("opening_blank", "closing_blank")  # sentences of a blank opening and closing
_FIRST, _LAST = "INDEX(capacity_height,1)", "INDEX(capacity_height,ROWS(capacity_height))"


def rows(record, number):
    """Rows of both gaugings, from the checks of the input to the weight in air."""
    return [
        *_levels(record, number),
        *_volumes(),
        *_shell(record),
        *_inputs(number),
        *factor_rows(),
        *_roof(record),
        *_steps(number),
    ]


def _guard(expression, state="level_state"):
    return f"IF([{state}@]=#fine,{expression},{NONE})"


def _fault(key, name):
    """Condition that a cell of a gauging contains no number within the limits of a ticket."""
    return fault(f"[{key}@]", *LIMITS[name])


def _levels(record, number):
    """Rows of the dip, and of the state of dips and temperatures."""
    reference = record["job"]["datum"]["reference_height_m"]
    roof = roof_of(record) if record["roof"] else None
    ullage = f"{reference!r}-[ullage@]" if reference is not None else "-1"
    level = f"IF(ISBLANK([ullage@]),[dip@],{ullage})"
    dip = f"IF(ISBLANK([ullage@]),{_fault('dip', 'dip_m')},{_fault('ullage', 'ullage_m')})"
    ambient = _fault("ambient", "ambient_c")
    cases = [
        ("AND(NOT(ISBLANK([dip@])),NOT(ISBLANK([ullage@])))", "dip_and_ullage"),
        ("AND(ISBLANK([dip@]),ISBLANK([ullage@]))", "no_dip"),
        (dip, "no_number"),
        *([] if reference is not None else [("NOT(ISBLANK([ullage@]))", "no_reference")]),
        (f"OR([level@]<{_FIRST},[level@]>{_LAST})", "outside_table"),
        *([(f"[level@]<{roof['roof_critical_top']!r}", "critical")] if roof else []),
        (f"AND(NOT(ISBLANK([water@])),{_fault('water', 'water_dip_m')})", "no_number"),
        ("[water@]>=[level@]", "water_above"),
        *(
            [(f"[water@]>{roof['roof_critical_bottom']!r}", "water_at_roof")]
            if roof and is_roof_in_table(record)
            else []
        ),
        (_fault("liquid", "temperature_c"), "liquid_blank"),
        (f"IF([insulated_code]=1,FALSE,{ambient})", "ambient_blank"),
        (f"AND(NOT(ISBLANK([ambient@])),{ambient})", "no_number"),
    ]
    blank = "AND(" + ",".join(
        f"ISBLANK([{key}@])" for key in ("dip", "ullage", "water", "liquid", "ambient", "factor")
    ) + ")"  # fmt: skip
    checked = first_true(cases, "#fine")
    states = state_row("level_state", "", f"IF({blank},#{BLANK[0]},{checked})",
                       tuple(map(number, BLANK)))  # fmt: skip
    opening, closing = states.cells
    closing = replace(closing, formula=closing.formula.replace(f"#{BLANK[0]}", f"#{BLANK[1]}"))
    return [state_row("level", "h", level, 0), replace(states, cells=(opening, closing))]


def interpolation_formulas(key, level):
    """Formulas of the row of a dip, position above it, slope and volume, {end of the key: text}."""
    low, high = (f"INDEX(capacity_height,[{key}_row@]{end})" for end in ("", "+1"))
    below, above = (f"INDEX(capacity_volume,[{key}_row@]{end})" for end in ("", "+1"))
    place = f"IF({level}<{_FIRST},1,MIN(MATCH({level},capacity_height,1),ROWS(capacity_height)-1))"
    return {
        "row": place,
        "part": f"({level}-{low})/({high}-{low})",
        "slope": f"({above}-{below})/({high}-{low})",
        "volume": f"{below}+[{key}_part@]*({above}-{below})",
    }


def _interpolate(key, level, symbol):
    """Rows of the row of a dip, position above it, slope and volume."""
    symbols = {"slope": f"∂{symbol}/∂h", "volume": symbol}
    return [
        state_row(f"{key}_{part}", symbols.get(part, ""), _guard(formula))
        for part, formula in interpolation_formulas(key, level).items()
    ]


def _volumes():
    """Rows of TOV and FW; water below the first row of the table is not subtracted."""
    has_water = f"IF(AND(ISNUMBER([water@]),[water@]>0,[water@]>={_FIRST}),1,0)"
    return [
        *_interpolate("tov", "[level@]", "TOV"),
        state_row("has_water", "", _guard(has_water)),
        state_row("water_level", "", _guard(f"IF([has_water@]=1,[water@],{_FIRST})")),
        *_interpolate("water", "[water_level@]", "FW"),
        state_row("fw", "FW", _guard("[has_water@]*[water_volume@]")),
        state_row("net", "TOV - FW", _guard("[tov_volume@]-[fw@]")),
    ]


def _shell(record):
    """Rows of the temperature of the shell, CTSh and its derivatives (by h, t and a)."""
    job = record["job"]
    a, base = job["material"]["expansion_per_k"], job["table"]["reference_temperature_c"]
    shell = state_row(
        "shell", "TSh", _guard("IF([insulated_code]=1,[liquid@],(7*[liquid@]+[ambient@])/8)")
    )
    warming = f"([shell@]-{base!r})"
    if job["tank"]["kind"] == "vertical":
        step = f"({a!r}*{warming})"
        return [
            shell,
            state_row("ctsh", "CTSh", _guard(f"1+2*{step}+{step}^2")),
            state_row("ctsh_h", "∂CTSh/∂h", _guard("0")),
            state_row("ctsh_t", "∂CTSh/∂TSh", _guard(f"2*{a!r}*(1+{step})")),
            state_row("ctsh_a", "∂CTSh/∂a", _guard(f"2*{warming}*(1+{step})")),
        ]
    # A solid expands in all directions: CTSh = s^3 V(h / s) / V(h), heights above the bottom.
    zero = record["capacity"]["zero_m"]
    height = f"([level@]+{zero!r})"
    is_empty = "[tov_volume@]<=0"
    by_s = (
        "IF(" + is_empty + ",0,(3*[s@]^2*[cold_volume@]-[s@]*[cold_slope@]*" + height
        + ")/[tov_volume@])"
    )  # fmt: skip
    by_h = f"IF({is_empty},0,([s@]^2*[cold_slope@]-[ctsh@]*[tov_slope@])/[tov_volume@])"
    return [
        shell,
        state_row("s", "s", _guard(f"1+{a!r}*{warming}")),
        state_row("cold", "h/s", _guard(f"{height}/[s@]-{zero!r}")),
        *_interpolate("cold", "[cold@]", "V(h/s)"),
        state_row("ctsh", "CTSh", _guard(
            f"IF({is_empty},1,[s@]^3*[cold_volume@]/[tov_volume@])")),
        state_row("ctsh_h", "∂CTSh/∂h", _guard(by_h)),
        state_row("ctsh_s", "∂CTSh/∂s", _guard(by_s)),
        state_row("ctsh_t", "∂CTSh/∂TSh", _guard(f"{a!r}*[ctsh_s@]")),
        state_row("ctsh_a", "∂CTSh/∂a", _guard(f"{warming}*[ctsh_s@]")),
    ]  # fmt: skip


def _inputs(number):
    """Row of the state of all inputs of a gauging, with those of the product."""
    low, high = FACTORS
    cases = [
        ("[product]<>#fine", "product_first"),
        ("OR([liquid@]<[t_low],[liquid@]>[t_high])", "liquid_range"),
        (
            f"IF([correction_code]={TYPED},{fault('[factor@]', low, high)},FALSE)",
            "factor_blank",
        ),
        (f"AND([correction_code]<>{TYPED},NOT(ISBLANK([factor@])))", "factor_unused"),
    ]
    state = f"IF([level_state@]=#fine,{first_true(cases, '#fine')},[level_state@])"
    return [state_row("inputs", "", state, tuple(map(number, BLANK)))]


def _roof(record):
    """Rows of the density in the tank, FRA, and its derivative by this density."""
    observed = state_row("rho_t", "ρ", _guard("[rho_b]*[vcf@]", "inputs"))
    if not record["roof"]:
        return [
            observed,
            state_row("fra", "FRA", _guard("0", "inputs")),
            state_row("fra_rho", "∂FRA/∂ρ", _guard("0", "inputs")),
        ]
    roof = roof_of(record)
    air = AIR_KG_M3 if roof["roof_weighing"] == "air" else 0.0
    mass = f"({roof['roof_mass']!r}*(1-{air!r}/{WEIGHTS_KG_M3!r}))"
    reference = f"{mass}/({roof['roof_reference_density']!r}-{air!r})"
    fra = f"{reference if is_roof_in_table(record) else '0'}-{mass}/([rho_t@]-{air!r})"
    return [
        observed,
        state_row("fra", "FRA", _guard(fra, "inputs")),
        state_row("fra_rho", "∂FRA/∂ρ", _guard(f"{mass}/([rho_t@]-{air!r})^2", "inputs")),
    ]


def _steps(number):
    """Rows from GOV to the weight in air, and of the state of the gauging."""
    buoyancy = f"(1-{AIR_KG_M3!r}/[rho_b])/(1-{AIR_KG_M3!r}/{WEIGHTS_KG_M3!r})"
    state = "IF([inputs@]=#fine,IF([gov@]>0,#fine,#negative),[inputs@])"
    return [
        state_row("gov", "GOV", _guard("[net@]*[ctsh@]+[fra@]", "inputs")),
        state_row("state", "", state, tuple(map(number, BLANK))),
        state_row("gsv", "GSV", _guard("[gov@]*[vcf@]", "state")),
        state_row("csw", "CSW", _guard("1-[sw]/100", "state")),
        state_row("nsv", "NSV", _guard("[gsv@]*[csw@]", "state")),
        state_row("mass", "m", _guard("[nsv@]*[rho_b]", "state")),
        state_row("air", "W/m", _guard(buoyancy, "state")),
        state_row("weight", "W", _guard("[mass@]*[air@]", "state")),
    ]
