"""Ticket of a transfer or of a stock: ticket.json.

The inputs are saved as declared, so that the ticket can be computed again from this file and the
record of the capacity table.
"""

import tankcal
from tankcal.messages import Message
from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Finite, Saved, WarningRecord, key

TICKET = SavedFormat("tankcal-ticket", 1, "ticket.json")


class TicketFileEntry(Saved):
    """A file from which the ticket was computed."""

    file: str = key("name")
    sha256: str = key("of the file")


class TableOfTicket(Saved):
    """The capacity table, and the certificate that it belongs to."""

    sha256: str = key("of record.json")
    kind: str = key('"vertical", "horizontal", "sphere" or "mesh"')
    number: str | None = key("of the certificate; null: not given")
    laboratory: str | None = key("null: not given")
    date: str = key("of the calibration, ISO")
    temperature_c: float = key("reference temperature of the shell")
    expansion_per_k: Finite = key("coefficient of linear expansion used for CTSh")
    reference_height_m: float | None = key("above the zero of the dips; null: not known")
    roof: str | None = key('"in_table", "not_in_table"; null: no floating roof')


class GaugingOfTicket(Saved):
    """Readings of a state of the tank."""

    state: str = key('"opening" or "closing"')
    level_m: Finite = key("dip, or reference height less ullage")
    ullage_m: float | None = key("null: the dip was measured")
    water_dip_m: float | None = key("null: no free water was subtracted")
    temperature_c: Finite = key("mean temperature of the liquid")
    ambient_c: float | None = key("of the air about the tank; null: insulated shell")
    pressure_kpa: Finite = key("gauge pressure above the liquid")


class StepOfTicket(Saved):
    """A step of the calculation."""

    step: str = key('such as "tov_m3", "ctsh", "vcf"')
    unit: str = key('"m3", "kg", "kg/m3", "degC" or ""')
    opening: float | None = key("null: no opening gauging")
    closing: Finite = key("value")


class QuantityOfTicket(Saved):
    """A quantity of a state, with its uncertainty."""

    state: str = key('"opening", "closing" or "moved" (closing less opening)')
    quantity: str = key('"tov_m3", "gov_m3", "gsv_m3", "nsv_m3", "mass_kg" or "weight_kg"')
    value: Finite = key("m3 or kg")
    u: Finite = key("standard uncertainty")
    dof: float | None = key("effective degrees of freedom; null: infinite")
    k: Finite = key("coverage factor")
    U: Finite = key("expanded uncertainty")


class RoomOfTicket(Saved):
    """Volume between the closing gauging and an operating level."""

    name: str = key('"room" (to the maximum), "above_minimum", "pumpable" (above the pump suction)')
    level_m: Finite = key("dip of the operating level")
    value: Finite = key("m3, observed, at the temperature of the shell; negative beyond the level")
    u: Finite = key("standard uncertainty")
    dof: float | None = key("effective degrees of freedom; null: infinite")
    k: Finite = key("coverage factor")
    U: Finite = key("expanded uncertainty")


class ContributionToTicket(Saved):
    """Contribution of an input to u of a quantity; the squares add up to u squared."""

    state: str = key("as in quantities")
    quantity: str = key("as in quantities")
    input: str = key('"table", "dip", "tape", "density" ...')
    gauging: str | None = key('"opening" or "closing" for an error of its own; null: common')
    contribution: Finite = key("with its sign, m3 or kg; without sign for the table")
    share: Finite = key("of the variance")


class UncertaintyOfTicket(Saved):
    """Standard uncertainty of an input."""

    name: str = key("key of [uncertainty]")
    value: float | None = key("in the unit of the name; null: by distance from the base")
    origin: str = key('"declared", "memory" (from memory) or "assumed"')


class ComparisonOfTicket(Saved):
    """Comparison with a meter or with the other party."""

    quantity: str = key("as in quantities")
    source: str = key('name of the meter or party; "": not given')
    value: Finite = key("of the other party")
    U: float | None = key("expanded, of the other party; null: not known")
    difference: Finite = key("quantity of the ticket, without its sign, less that value")
    e_n: float | None = key("difference over the root of the sum of the squared U; null: unknown")
    agrees: bool | None = key("|E_n| is at most 1; null: not decided")


class FactorsOfTicket(Saved):
    """A supplied table of volume correction factors."""

    file: str = key("name")
    density_kg_m3: list[Finite] = key("at the base temperature, ascending")
    temperature_c: list[Finite] = key("ascending")
    factor: list[list[Finite]] = key("a row for each temperature")


class TicketFile(Saved, kw_only=True):
    """Ticket of a transfer or of a stock."""

    format: str = key("see Versions", default=TICKET.format)
    tankcal: str = key("version of tankcal", default=tankcal.__version__)
    notice: str = key("on every page of the reports of the record, such as EXAMPLE")
    tank: str = key("its id")
    number: str = key("of the ticket")
    date: str | None = key("of the transfer, ISO; null: not given")
    by: str | None = key("person who gauged the tank; null: not given")
    customer: str | None = key("null: not given")
    product: str | None = key("its name; null: not given")
    note: str | None = key("remark; null: none")
    probability: Finite = key("coverage probability of each U")
    table: TableOfTicket = key("capacity table")
    correction: Message = key("volume correction, with edition, group and base")
    base_c: Finite = key("base temperature")
    density_kg_m3: Finite = key("as declared")
    density_is: str = key('"base" or "observed"')
    density_temperature_c: float | None = key("of the sample; null: density at the base")
    sw_percent: float | None = key("suspended sediment and water; null: not declared")
    air_kg_m3: Finite = key("density of the air, for the weight in air")
    weights_kg_m3: Finite = key("density of the weights, for the weight in air")
    insulated: bool = key("whether the shell is insulated")
    gaugings: list[GaugingOfTicket] = key("closing last")
    steps: list[StepOfTicket] = key("in the order of the calculation")
    quantities: list[QuantityOfTicket] = key("by state")
    rooms: list[RoomOfTicket] | None = key(
        "to the operating levels; left out if the job has none", default=None, optional=True
    )
    budget: list[ContributionToTicket] = key("of every quantity, the largest first")
    uncertainties: list[UncertaintyOfTicket] = key("of the inputs in use")
    comparison: ComparisonOfTicket | None = key("null: none")
    not_in_u: list[str] = key("codes of effects that U does not contain")
    factors: FactorsOfTicket | None = key("supplied volume correction; null: another correction")
    inputs: dict = key("keys of ticket.toml as declared, by section")
    files: list[TicketFileEntry] = key("input files; empty: the inputs were given in Python")
    warnings: list[WarningRecord] = key("inputs that are probably wrong")
