"""Lengths at the table's reference temperature."""


def thermal_scale(job, switches):
    """Lengths at reference temperature over those of the survey; 1 if not known or not on."""
    if not is_warmed(job, switches):
        return 1.0
    warmer = job.table.reference_temperature_c - job.survey.shell_temperature_c
    return 1.0 + job.material.expansion_per_k * warmer


def is_warmed(job, switches):
    return switches.temperature and job.survey.shell_temperature_c is not None
