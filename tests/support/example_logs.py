"""The generator of everyday data of examples/upkeep, as a module of the tests."""

import importlib.util
from pathlib import Path

_PATH = Path(__file__).parents[2] / "examples" / "upkeep" / "simulate.py"
_SPEC = importlib.util.spec_from_file_location("example_of_upkeep", _PATH)
_MODULE = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(_MODULE)
Station, TrueTank, write_station = _MODULE.Station, _MODULE.TrueTank, _MODULE.write_station
make_station, make_upright = _MODULE.make_station, _MODULE.make_upright
