"""Import of field books of total stations into the CSV files of a job.

One module reads each format (`gsi`, `rw5`, `jobxml`, `sdr`, `profile`) into a `FieldBook`. The
other modules do not depend on the format: `rows` averages the two faces, separates hits
and targets, and makes the rows of the tables. `writing` writes them to the folder of the job.
"""

from tankcal.products.base import Product


class FieldBooks(Product):
    """Files of instruments."""

    name = "fieldbooks"
    commands = (("import", "tankcal.products.fieldbooks.command"),)
