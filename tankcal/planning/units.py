"""Warn of values of a plan whose size suggests a wrong unit. No value is refused."""

import numpy as np

from tankcal.job.checking import tell, tiny_sd
from tankcal.job.checks.survey.doubtful import TINY
from tankcal.messages import list_some, message
from tankcal.planning.given import PLAN_FILE
from tankcal.planning.model import Box

FAR_M = 1000.0  # largest plausible distance of an obstacle from the wall
SHOWN = 5  # largest number of obstacles listed in a message
LOOSE = 0.05  # U over volume; a larger limit is suspected to be in percent
OF_RINGS = {"photo_rings": {"s_um": "um"}, "tapes": {"s_mm": "mm"}}
OF_RINGS["setup_rings"] = {
    "s_direction_arcsec": "arcsec",
    "s_zenith_arcsec": "arcsec",
    "s_mm": "mm",
}


def warn_of_units(given, raw, values, log):
    """Warn of tiny standard deviations, and of a limit that looks like percent."""
    common = None if values is None else values["adjustment"]["image_sd_um"]
    if common and common < TINY["um"]:
        tell(log.warning, raw, "adjustment", "image_sd_um", tiny_sd("um", common))
    for section, units in OF_RINGS.items():
        for entry in given.repeated[section]:
            for key, unit in units.items():
                if entry[key] and entry[key] < TINY[unit]:
                    entry.tell(log.warning, key, tiny_sd(unit, entry[key]))
    for table in (*given.ties.values(), given.stadia):
        unit = "arcsec" if table is given.stadia else "mm"
        sds = np.empty(0) if table is None else table.numbers(f"s_{unit}")
        if (sds > 0).any() and sds[sds > 0].max() < TINY[unit]:
            log.warning(table.file, tiny_sd(unit, sds[sds > 0].max()), None, f"s_{unit}")
    limit = given.single["limits"]
    if (limit["relative_u"] or 0.0) > LOOSE:
        text = message(
            "plan_limit_loose",
            "found {share:g}, which is {percent:.3g} % of the volume: is it given in "
            "percent? 0.2 % is 0.002",
            share=limit["relative_u"],
            percent=100 * limit["relative_u"],
        )
        limit.tell(log.warning, "relative_u", text)


def warn_of_places(plan, given, log):
    """Warn of obstacles far from the tank, and of tapes that cannot hang on the shell."""
    shell = plan.shell
    heights = [shell.low_m, shell.high_m]
    heights += [stand.xyz_m[2] for stand in (*plan.photos, *plan.setups)]
    far = []
    for obstacle in plan.obstacles:
        low, high = (float(np.ravel(end)[-1]) for end in (obstacle.low_m, obstacle.high_m))
        away = _distance_to_wall_m(obstacle, shell)
        if away > FAR_M or low > max(heights) or high < min(heights):
            far.append(_describe_obstacle(obstacle.name, away, low, high))
    if far:
        text = message(
            "plan_obstacles_far",
            "hide nothing, because the shell is at z = {bottom_m:.6g} to {top_m:.6g} m: "
            "{obstacles}; are they in the frame of the survey, in metres?",
            bottom_m=float(shell.low_m),
            top_m=float(shell.high_m),
            obstacles=list_some(far, SHOWN),
        )
        log.warning(PLAN_FILE, text, given.repeated["obstacles"][0].row, "obstacles")
    for entry in given.repeated["tapes"]:
        _warn_of_tape(plan, entry, log)


def _describe_obstacle(name, away_m, low_m, high_m):
    return message(
        "plan_obstacle_place",
        "{obstacle} ({away_m:.6g} m from the wall, z {low_m:.6g} to {high_m:.6g} m)",
        obstacle=name,
        away_m=away_m,
        low_m=low_m,
        high_m=high_m,
    )


def _distance_to_wall_m(obstacle, shell):
    """Horizontal distance of an obstacle from the wall, m; 0 if it reaches the wall."""
    if isinstance(obstacle, Box):
        low, high = obstacle.low_m[:2], obstacle.high_m[:2]
        away = np.hypot(*(np.clip(shell.axis_m, low, high) - shell.axis_m))
    else:
        away = np.hypot(*(obstacle.axis_m - shell.axis_m)) - obstacle.radius_m
    return max(float(away) - shell.radius_m, 0.0)


def _warn_of_tape(plan, entry, log):
    """Warn of a tape with ends above the shell, or farther from the wall than the tank radius."""
    shell = plan.shell
    ends = np.array([plan.extra[f"{entry['name']}{end}"] for end in "ab"])
    off = np.abs(np.hypot(*(ends[:, :2] - shell.axis_m).T) - shell.radius_m).max()
    above = ends[:, 2].max() - shell.high_m
    if off > shell.radius_m or above > 0:
        text = message(
            "plan_tape_off",
            "the ends of {tape} are up to {off_m:.1f} m from the wall and {above_m:+.1f} m from the"
            " top of the shell: can it hang there?",
            tape=entry["name"],
            off_m=float(off),
            above_m=float(above),
        )
        log.warning(PLAN_FILE, text, entry.row, entry.name)
