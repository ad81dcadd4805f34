"""Covariances of the components of a wall between the sites where it was measured.

What follows a seam is a product c(a - a') h(zeta, zeta'). All else is a sum of products of columns:
a few waves around the tank, or one mean radius, times polynomials in the height.
"""

from functools import cached_property

import numpy as np
import scipy.linalg

from tankcal.geometry.field.components import COMPONENTS, seam_correlations, wave_columns
from tankcal.geometry.field.sites import distinct_azimuths


def without_rounding(covariance):
    """The nearest covariance: differences leave rounding below zero."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    return (vectors * np.maximum(values, 0.0)) @ vectors.T


class Covariances:
    """Of the components of unit variance at sites.

    Parameters
    ----------
    sites : Sites
    nominal_m : float
        Radius of the tank, m.

    Attributes
    ----------
    place : ndarray of int, shape (n,)
        Of each site among the distinct azimuths.
    azimuths_rad : ndarray, shape (a,)
        These.
    """

    def __init__(self, sites, nominal_m):
        self.sites, self.nominal_m = sites, nominal_m
        self.place, self.azimuths_rad = distinct_azimuths(sites.azimuth_rad)
        self._in_order = len(self.azimuths_rad) == len(sites)
        if self._in_order:  # of the sites: nothing to gather
            self.azimuths_rad = self.azimuths_rad[self.place]
            self.place = np.arange(len(sites))

    @cached_property
    def members(self):
        """For each course the indices of its sites."""
        return self.sites.members

    def at_sites(self, columns, members=slice(None)):
        """Columns (k, a) of the distinct azimuths, as those of some sites."""
        if self._in_order:
            return columns[:, members]
        return columns[:, self.place[members]]

    @cached_property
    def runs(self):
        """The same as `members`: slices where the sites of a course follow each other."""
        return [
            slice(int(one[0]), int(one[-1]) + 1) if len(one) and np.all(np.diff(one) == 1) else one
            for one in self.members
        ]

    def total(self, variances_m2):
        """(n, n) covariance of the sum of all components, m2.

        Parameters
        ----------
        variances_m2 : ndarray, shape (components,)
        """
        everywhere = slice(None)
        found = self._seams(everywhere) * self._up(True, variances_m2, everywhere)
        common = [i for i in self._columns if COMPONENTS[i].common]
        columns = [np.sqrt(variances_m2[i]) * self._columns[i] for i in common]
        if self.sites.welds_rad:
            columns += [np.sqrt(variances_m2[i]) * one for i, one in self.peaks.items()]
        _add_products(found, np.hstack(columns))
        for members in self.runs:
            block = self._seams(members) * self._up(False, variances_m2, members)
            own = [
                np.sqrt(variances_m2[i]) * columns[members]
                for i, columns in self._columns.items()
                if i not in common
            ]
            _add_products(block, np.hstack(own))
            both = (members, members) if isinstance(members, slice) else np.ix_(members, members)
            found[both] += block
        return found

    def spread(self, weights, index):
        """(f, f) covariance of functionals (f, n) of the sites, by one component."""
        return sum(left @ right.T for left, right in self._halves(weights, index))

    def spread_alone(self, weights, index):
        """(f,) variances of them, without their covariances."""
        halves = self._halves(weights, index)
        return sum(np.einsum("fk,fk->f", left, right) for left, right in halves)

    def _halves(self, weights, index):
        """Pairs (f, k) whose products add up to the covariance of functionals by one component."""
        one = COMPONENTS[index]
        common = one.common or index in self.peaks
        for members in [slice(None)] if common else self.runs:
            part = weights[:, members]
            if one.shape == "seam":
                seams = self._seams(members)
                seams = seams if one.is_level else seams * self._height(index, members)
                yield part @ seams, part
            else:
                columns = self.peaks if index in self.peaks else self._columns
                by_columns = part @ columns[index][members]
                yield by_columns, by_columns

    @cached_property
    def peaks(self):
        """{component: (n, k) derivative of the sites by the peaks of welds}: of all, of each."""
        alone = scipy.linalg.block_diag(*self.sites.welds_at(self.nominal_m))
        alone = alone[np.argsort(np.concatenate(self.members), kind="stable")]
        return {
            index: alone.sum(axis=1, keepdims=True) if one.common else alone
            for index, one in enumerate(COMPONENTS)
            if one.shape == "weld"
        }

    @cached_property
    def _columns(self):
        """{component: (n, k) columns whose products are it}, of mean radii and of waves."""
        waves, heights = wave_columns(self.sites.azimuth_rad), self.sites.heights
        return {
            index: one.columns(waves, heights)
            for index, one in enumerate(COMPONENTS)
            if one.shape in ("mean", "oval", "settled")
        }

    def _up(self, common, variances_m2, members):
        """Sum of the variances of seams times h between some sites; one number if all are level."""
        return sum(
            variances_m2[i] * self._height(i, members)
            for i, one in enumerate(COMPONENTS)
            if (one.shape, one.common) == ("seam", common)
        )

    def _height(self, index, members):
        """h of one component between some sites; one number if it is level."""
        one = COMPONENTS[index]
        if one.is_level:
            return 1.0
        heights = self.sites.heights[members]
        return one.height_covariance(heights, heights)

    def _seams(self, members):
        """c of seams between some sites."""
        if self._in_order and isinstance(members, slice):
            return self._along[members, members]
        place = self.place[members]
        return self._along[place[:, None], place]

    @cached_property
    def _along(self):
        return seam_correlations(self.azimuths_rad, self.azimuths_rad, self.nominal_m)


def _add_products(matrix, columns):
    """Add columns @ columns.T to a symmetric matrix, in its place."""
    scipy.linalg.blas.dgemm(
        1.0, columns, columns, beta=1.0, c=matrix.T, trans_b=True, overwrite_c=True
    )
