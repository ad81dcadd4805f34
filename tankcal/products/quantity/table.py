"""Capacity table of a record: volumes at any dip, and their covariance."""

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tankcal import record as records
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.record.covariance_factor import factor_of
from tankcal.record.manifest import digest_of
from tankcal.record.schema import Saved, to_plain
from tankcal.tank.fittings import FloatingRoof, floating_roof
from tankcal.tank.gauging import room_levels


@dataclass(frozen=True)
class TankTable:
    """Capacity table of a tank.

    Attributes
    ----------
    tank : str
        Name of the tank.
    kind : str
        Kind of tank: "vertical", "horizontal", "sphere" or "mesh".
    height_m, volume_m3 : ndarray, shape (rows,)
        Dips, ascending, and volumes at the reference temperature of the shell.
    factor_m3 : ndarray, shape (rows, inputs)
        Factor F of the covariance F F' of the volumes.
    dof : ndarray, shape (rows,)
        Degrees of freedom of the rows.
    interpolation_m3 : float
        Largest error of linear interpolation between two rows.
    temperature_c : float
        Reference temperature of the shell.
    expansion_per_k : float
        Coefficient of linear expansion of the shell, 1/K.
    zero_m : float
        Height of the zero of the dips above the bottom of the tank.
    roof : FloatingRoof or None
        Floating roof of the tank.
    is_roof_in_table : bool
        The table contains the displacement of the roof at its reference density.
    reference_height_m : float or None
        Height of the reference point above the zero of the dips, for ullages.
    digest : str
        SHA-256 of the record.
    certificate : dict
        Section [certificate] of the job.
    date : str
        Date of the calibration, ISO.
    levels : dict
        Section [levels] of the job: {"maximum_m": dip or None ...}.
    high_legs_m : tuple of float
        Dips between which another table applies to a roof on high legs; () without that position.
    """

    tank: str
    kind: str
    height_m: np.ndarray
    volume_m3: np.ndarray
    factor_m3: np.ndarray
    dof: np.ndarray
    interpolation_m3: float
    temperature_c: float
    expansion_per_k: float
    zero_m: float = 0.0
    roof: FloatingRoof | None = None
    reference_height_m: float | None = None
    digest: str = ""
    is_roof_in_table: bool = True
    certificate: Mapping = field(default_factory=dict)
    date: str = ""
    levels: Mapping = field(default_factory=dict)
    high_legs_m: tuple = ()

    def volume(self, level_m):
        """Volume at each dip, m3, linear between two rows; (n,) real or complex dips."""
        row, share = self._place(level_m)
        low, high = self.volume_m3[row], self.volume_m3[row + 1]
        return low + share * (high - low)

    def factor(self, level_m):
        """Factor of the covariance of the volumes at (n,) dips, shape (n, inputs), m3."""
        row, share = self._place(np.real(level_m))
        return self.factor_m3[row] + share[:, None] * (
            self.factor_m3[row + 1] - self.factor_m3[row]
        )

    def dof_at(self, level_m):
        """Degrees of freedom at each dip: the smaller value of the two neighbouring rows."""
        row, _ = self._place(np.real(level_m))
        return np.minimum(self.dof[row], self.dof[row + 1])

    def is_outside(self, level_m):
        """Whether each dip is below the first or above the last row, shape (n,)."""
        return ~((level_m >= self.height_m[0]) & (level_m <= self.height_m[-1]))

    def is_critical(self, level_m):
        """Whether each dip is below the level from which the roof floats, shape (n,)."""
        if self.roof is None:
            return np.zeros(np.shape(level_m), dtype=bool)
        return level_m < self.roof.critical_top_m

    def room_levels(self):
        """{name of ROOMS: dip} of the operating levels of the tank that are for use."""
        roof = self.roof
        zone = None if roof is None else (roof.critical_bottom_m, roof.critical_top_m)
        return room_levels(self.levels, self.height_m[0], self.height_m[-1], zone)

    def roof_correction_m3(self, observed_kg_m3):
        """Correction FRA of a volume of the table for the roof, m3, at (n,) observed densities."""
        if self.roof is None:
            return 0.0 * observed_kg_m3
        if self.is_roof_in_table:
            # The table contains the roof at its reference density; in a lighter liquid the roof
            # sinks deeper.
            return self.roof.density_correction_m3(observed_kg_m3)
        return -self.roof.displacement_m3(observed_kg_m3)

    def _place(self, level_m):
        """Row below each dip, and position between this row and the next one, 0 to 1."""
        row = np.searchsorted(self.height_m, np.real(level_m), side="right") - 1
        row = np.clip(row, 0, len(self.height_m) - 2)
        low, high = self.height_m[row], self.height_m[row + 1]
        return row, (level_m - low) / (high - low)


def table_of(source):
    """Return the table of a result or record.

    Parameters
    ----------
    source : Result, dict, Record or path
        Result of `tankcal.run`, record of `tankcal.record.load` or `read`, or a record.json or its
        folder.

    Returns
    -------
    TankTable

    Raises
    ------
    InputError
        As `read_table`.
    """
    if isinstance(source, str | Path):
        path = Path(source)
        return read_table(path / "record.json" if path.is_dir() else path)
    if isinstance(source, Saved):
        source = to_plain(source)
    record = source if isinstance(source, Mapping) else records.record_of(source)
    with tempfile.TemporaryDirectory(prefix="tankcal-") as folder:
        path = Path(folder) / "record.json"
        records.save(record, path)  # the SHA-256 is that of the file
        return read_table(path)


def read_table(path, record=None):
    """Read the table of a record.

    Parameters
    ----------
    path : Path
        A record.json.
    record : dict, optional
        Its content, if it was read already.

    Returns
    -------
    TankTable

    Raises
    ------
    InputError
        If the file is no record, or contains no capacity table.
    """
    record = records.load(path) if record is None else record
    capacity, job = record["capacity"], record["job"]
    if not capacity:
        expected = message(
            "ticket_no_table", "the record of a survey without a tank; expected one with a table"
        )
        raise InputError(Problem(path.name, expected))
    interpolation, raised = record.get("interpolation"), record.get("on_high_legs") or ()
    return TankTable(
        tank=job["tank"]["id"],
        kind=job["tank"]["kind"],
        height_m=np.array(capacity["height_m"]),
        volume_m3=np.array(capacity["volume_m3"]),
        factor_m3=factor_of(capacity),
        dof=np.array([np.inf if dof is None else dof for dof in capacity["dof"]]),
        interpolation_m3=interpolation["largest_m3"] if interpolation else 0.0,
        temperature_c=job["table"]["reference_temperature_c"],
        expansion_per_k=job["material"]["expansion_per_k"],
        zero_m=capacity["zero_m"],
        roof=_read_roof(record),
        is_roof_in_table=all(
            choice["value"] != "off" for choice in record["choices"] if choice["code"] == "roof"
        ),
        reference_height_m=job["datum"]["reference_height_m"],
        digest=digest_of(path),
        certificate=job["certificate"],
        date=job["survey"]["date"],
        levels=job.get("levels") or {},
        high_legs_m=tuple(row["height_m"] for row in raised[:: max(len(raised) - 1, 1)]),
    )


def _read_roof(record):
    """`FloatingRoof` of a record, or None."""
    details = {detail["code"]: detail["value"] for detail in record["roof"] or ()}
    if not details:
        return None
    return floating_roof(
        details["roof_mass"],
        details["roof_critical_bottom"],
        details["roof_critical_top"],
        details["roof_reference_density"],
        details["roof_weighing"],
    )
