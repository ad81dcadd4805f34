"""Field books of total stations: what instruments export becomes the CSV files of a job.

One module reads one format (`gsi`, `rw5`, `jobxml`, `sdr`, `profile`) into a `FieldBook`; all that
follows knows no format: `faces` joins the two faces, `sorting` tells hits from targets, `rows`
makes the rows of the job's tables, `writing` puts them into its folder.
"""

from tankcal.fieldbooks.importing import Choices, Imported, import_fieldbooks

__all__ = ["Choices", "Imported", "import_fieldbooks"]
