"""Exact shapes for tests: outlines in closed form, and points on them."""

import numpy as np

import tankcal.sections as sections
from tankcal.tank.volumes import CourseShape, gauss_levels


def ring(radius, azimuth, centre=(0.0, 0.0), z=0.0):
    """(n, 3) points at a radius (number, array or function of the azimuth)."""
    r = radius(azimuth) if callable(radius) else radius * np.ones_like(azimuth)
    x, y = centre[0] + r * np.sin(azimuth), centre[1] + r * np.cos(azimuth)
    return np.column_stack([x, y, np.full_like(azimuth, z)])


def azimuths(count, jitter=0.0, rng=None):
    """Even azimuths, each moved by up to +- jitter of the spacing."""
    moved = np.arange(count) + (rng.uniform(-jitter, jitter, count) if jitter else 0.0)
    return moved * 2 * np.pi / count


def modes(radius, first, cosines, sines):
    """(function r(azimuth), exact area) of radius + Fourier modes first, first + 1, ..."""
    numbers = first + np.arange(len(cosines))

    def outline(azimuth):
        angles = np.multiply.outer(azimuth, numbers)
        return radius + np.cos(angles) @ cosines + np.sin(angles) @ sines

    return outline, np.pi * radius**2 + np.pi / 2 * (cosines @ cosines + sines @ sines)


def section_of(xyz, z=0.0, course=0, variance=1e-6, form_m2=1e-2):
    """A section fitted through points with one variance for every coordinate."""
    group = sections.Group("1", course, z, np.arange(len(xyz)))
    covariance = variance * np.eye(3 * len(xyz))
    return sections.fit_section(group, xyz, covariance, (0.0, 0.0), z, form_m2)


def course_of(bottom, top, radius_at, *, inset_m=0.0, scale=1.0, missed=None, count=72):
    """A CourseShape of surveyed radii: radius_at(z) a number or a function of the azimuth."""
    heights = bottom + gauss_levels() * (top - bottom)
    radii = np.stack([ring(radius_at(z), azimuths(count))[:, :2] for z in heights])
    inside = scale * (np.hypot(*radii.transpose(2, 0, 1)) - inset_m)
    return CourseShape(bottom, top, inside, inset_m, scale, missed or {})
