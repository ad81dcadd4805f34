"""A tank as a closed mesh; on a ship, sounded through a pipe at any trim and list."""

from tankcal.methods.base import Delegate, Method


class MeshMethod(Method):
    """A surface that encloses the tank, from the file of mesh.file."""

    name = "mesh"
    attribute = "mesh"
    kinds = ("mesh",)
    computes_top = True
    counts_from_plate = True

    # ---- job

    def is_given(self, tables):
        return True  # a setting that every job of this kind needs, in place of a table

    def check(self, values, tables, registers, raw, log):
        from tankcal.job.contract.ship import check_ship

        if values is not None:
            check_ship(values, tables, raw, log)

    def useless_inputs(self, values, tables):
        from tankcal.job.contract.ship import useless_inputs_of_ship

        return useless_inputs_of_ship(values)

    def read(self, values, tables, registers, raw):
        from tankcal.job.contract.keys import MESH_UNITS_M
        from tankcal.job.model import Mesh

        name = values["mesh"]["file"]
        return Mesh(name, MESH_UNITS_M[values["mesh"]["unit"]], raw.archives[name])

    # ---- pipeline

    def find(self, job, progress, network):
        from tankcal.messages import message
        from tankcal.methods.mesh.ship import check_pipe
        from tankcal.pipeline.surveying import Surveyed
        from tankcal.tank.meshes import parse_mesh

        progress(message("checking_mesh", "checking the mesh {file}", file=job.mesh.file))
        mesh = parse_mesh(job.mesh.file, job.mesh.data, job.mesh.unit_m)
        if job.ship is not None:
            check_pipe(job, mesh)
        return Surveyed(job, mesh)

    part = Delegate("tankcal.methods.mesh.ship:part_of_mesh")

    def input_values(self, job):
        from tankcal.methods.mesh.ship import values_of_ship

        return {} if job.ship is None else values_of_ship(job.ship)

    def undeclared(self, job, survey):
        from tankcal.methods.mesh.ship import undeclared_of_ship

        return () if job.ship is None else undeclared_of_ship(job, survey)

    def correction_tables(self, job, survey, body, table, progress):
        from tankcal.methods.mesh.ship import ship_tables

        return None if job.ship is None else ship_tables(job, survey, body, table, progress)

    # ---- record

    def zero(self, job):
        return None if job.ship is None else "pipe_bottom"

    def choices(self, result):
        return {"thickness": "surface"}

    def sizes(self, result):
        faces = result.body.parts[0].solid.face_count
        return {"mesh_file": (result.job.mesh.file, None), "mesh_faces": (faces, "")}
