"""Covariances of the components of a wall between sites.

The covariance of seams is a product c(a - a') h(zeta, zeta'). All other covariances are sums of
products of columns: a few waves around the tank, or the mean radius, times polynomials in the
height.
"""

from functools import cached_property

import numpy as np
import scipy.linalg

from tankcal.geometry.field.components import COMPONENTS, seam_correlations, wave_columns
from tankcal.geometry.field.sites import distinct_azimuths


def clip_to_semidefinite(covariance):
    """Return the nearest positive semidefinite matrix, as differences may be indefinite."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    return (vectors * np.maximum(values, 0.0)) @ vectors.T


class Covariances:
    """Covariances of the components, of unit variance, between sites.

    Parameters
    ----------
    sites : Sites
        n sites.
    nominal_m : float
        Radius of the tank, m.

    Attributes
    ----------
    place : ndarray of int, shape (n,)
        Index of the azimuth of each site among the distinct azimuths.
    azimuths_rad : ndarray, shape (a,)
        Distinct azimuths.
    """

    def __init__(self, sites, nominal_m):
        self.sites, self.nominal_m = sites, nominal_m
        self.place, self.azimuths_rad = distinct_azimuths(sites.azimuth_rad)
        self._in_order = len(self.azimuths_rad) == len(sites)
        if self._in_order:  # all azimuths are distinct: keep the order of the sites
            self.azimuths_rad = self.azimuths_rad[self.place]
            self.place = np.arange(len(sites))

    @cached_property
    def members(self):
        """Return the indices of the sites of each course."""
        return self.sites.members

    def columns_at_sites(self, columns, members=slice(None)):
        """Return columns (k, a) of the distinct azimuths, rearranged for some sites."""
        if self._in_order:
            return columns[:, members]
        return columns[:, self.place[members]]

    @cached_property
    def runs(self):
        """Return `members`, with slices for courses whose sites are consecutive."""
        return [
            slice(int(indices[0]), int(indices[-1]) + 1)
            if len(indices) and np.all(np.diff(indices) == 1)
            else indices
            for indices in self.members
        ]

    def total(self, variances_m2):
        """Return the covariance (n, n) of the sum of all components, m2.

        Parameters
        ----------
        variances_m2 : ndarray, shape (components,)

        Returns
        -------
        ndarray, shape (n, n)
        """
        everywhere = slice(None)
        # First the common components, over all sites; then the own components, in the blocks of
        # courses.
        covariance = self._seams(everywhere) * self._up(True, variances_m2, everywhere)
        common = [i for i in self._columns if COMPONENTS[i].common]
        columns = [np.sqrt(variances_m2[i]) * self._columns[i] for i in common]
        if self.sites.welds_rad:
            columns += [
                np.sqrt(variances_m2[i]) * peaks_of_component
                for i, peaks_of_component in self.peaks.items()
            ]
        _add_products(covariance, np.hstack(columns))
        for members in self.runs:
            block = self._seams(members) * self._up(False, variances_m2, members)
            own_columns = [
                np.sqrt(variances_m2[i]) * columns[members]
                for i, columns in self._columns.items()
                if i not in common
            ]
            _add_products(block, np.hstack(own_columns))
            block_index = (
                (members, members) if isinstance(members, slice) else np.ix_(members, members)
            )
            covariance[block_index] += block
        return covariance

    def spread(self, weights, index):
        """Return the covariance (f, f) of functionals (f, n) of the sites due to a component."""
        return sum(left @ right.T for left, right in self._halves(weights, index))

    def spread_alone(self, weights, index):
        """Return the variances (f,) of functionals (f, n) due to a component."""
        halves = self._halves(weights, index)
        return sum(np.einsum("fk,fk->f", left, right) for left, right in halves)

    def _halves(self, weights, index):
        """Yield pairs (f, k) whose products sum to the covariance due to a component."""
        component = COMPONENTS[index]
        common = component.common or index in self.peaks
        for members in [slice(None)] if common else self.runs:
            part = weights[:, members]
            if component.shape == "seam":
                seams = self._seams(members)
                seams = seams if component.is_level else seams * self._height(index, members)
                yield part @ seams, part
            else:
                columns = self.peaks if index in self.peaks else self._columns
                by_columns = part @ columns[index][members]
                yield by_columns, by_columns

    @cached_property
    def peaks(self):
        """Return {component: derivative (n, k) of the sites by the peaks of welds}.

        A common component has a single peak height for all welds (k = 1), otherwise each weld has
        its own.
        """
        by_weld = scipy.linalg.block_diag(*self.sites.welds_at(self.nominal_m))
        by_weld = by_weld[np.argsort(np.concatenate(self.members), kind="stable")]
        return {
            index: by_weld.sum(axis=1, keepdims=True) if component.common else by_weld
            for index, component in enumerate(COMPONENTS)
            if component.shape == "weld"
        }

    @cached_property
    def _columns(self):
        """Return {component: columns (n, k) A with A A' = covariance}, for mean radii and waves."""
        waves, heights = wave_columns(self.sites.azimuth_rad), self.sites.heights
        return {
            index: component.columns(waves, heights)
            for index, component in enumerate(COMPONENTS)
            if component.shape in ("mean", "oval", "settled")
        }

    def _up(self, common, variances_m2, members):
        """Return the sum of variance times h of seams; a number if all are level."""
        return sum(
            variances_m2[i] * self._height(i, members)
            for i, component in enumerate(COMPONENTS)
            if (component.shape, component.common) == ("seam", common)
        )

    def _height(self, index, members):
        """Return h of a component between some sites; a number for a level component."""
        component = COMPONENTS[index]
        if component.is_level:
            return 1.0
        heights = self.sites.heights[members]
        return component.height_covariance(heights, heights)

    def _seams(self, members):
        """Return c of seams between some sites."""
        if self._in_order and isinstance(members, slice):
            return self._seam_correlations[members, members]
        place = self.place[members]
        return self._seam_correlations[place[:, None], place]

    @cached_property
    def _seam_correlations(self):
        """Return c of seams between the distinct azimuths."""
        return seam_correlations(self.azimuths_rad, self.azimuths_rad, self.nominal_m)


def _add_products(matrix, columns):
    """Add columns @ columns.T to a symmetric matrix in place."""
    # BLAS expects column order: the transpose of a C-ordered symmetric matrix, without a copy.
    scipy.linalg.blas.dgemm(
        1.0, columns, columns, beta=1.0, c=matrix.T, trans_b=True, overwrite_c=True
    )
