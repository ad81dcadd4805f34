"""Covariances of the components of a wall between the sites where it was measured.

All components of one shape, common or own, are one product

    c(a - a') * sum of variance * h(zeta, zeta'),

so that the sum of all takes five products however many components there are.
"""

from functools import cached_property

import numpy as np
import scipy.linalg

from tankcal.geometry.field.components import COMPONENTS, azimuth_correlations
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
        if len(self.azimuths_rad) == len(sites):  # in the order of the sites: nothing to gather
            self.azimuths_rad = self.azimuths_rad[self.place]
            self.place = np.arange(len(sites))

    @cached_property
    def members(self):
        """For each course the indices of its sites."""
        return self.sites.members

    def total(self, variances_m2):
        """(n, n) covariance of the sum of all components, m2.

        Parameters
        ----------
        variances_m2 : ndarray, shape (components,)
        """
        found = np.zeros((len(self.place),) * 2)
        for shape in self._along:
            chosen = [i for i, one in enumerate(COMPONENTS) if one.shape == shape]
            common = [i for i in chosen if COMPONENTS[i].common]
            if common:
                everywhere = slice(None)
                found += self._between(shape, everywhere) * self._up(common, variances_m2)
            own = [i for i in chosen if not COMPONENTS[i].common]
            for members in self.members:
                there = np.ix_(members, members)
                found[there] += self._between(shape, members) * self._up(own, variances_m2, members)
        if self.sites.welds_rad:
            for index, columns in self.peaks.items():
                found += variances_m2[index] * columns @ columns.T
        return found

    def spread(self, weights, index):
        """(f, f) covariance of functionals (f, n) of the sites, by one component."""
        one, zeta = COMPONENTS[index], self.sites.zeta
        if index in self.peaks:
            part = weights @ self.peaks[index]
            return part @ part.T
        if one.orders == "local":
            found = 0.0
            for members in self.members:
                height = one.height_covariance(zeta[members], zeta[members])
                part = weights[:, members]
                found = found + part @ (self._between(one.shape, members) * height) @ part.T
            return found
        found, columns = 0.0, one.height_columns(zeta)
        for members in [slice(None)] if one.common else self.members:
            for column in columns.T:
                part = weights[:, members] * column[members]
                if one.shape == "mean":
                    total = part.sum(axis=1)
                    found = found + np.outer(total, total)
                else:
                    found = found + part @ self._between(one.shape, members) @ part.T
        return found

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

    def _up(self, chosen, variances_m2, members=slice(None)):
        """Sum of the variances times h, between the heights of some sites; one number if level."""
        if all(COMPONENTS[i].is_level for i in chosen):
            return np.sum(variances_m2[chosen])
        zeta = self.sites.zeta[members]
        local = [i for i in chosen if COMPONENTS[i].orders == "local"]
        columns = [
            np.sqrt(variances_m2[i]) * COMPONENTS[i].height_columns(zeta)
            for i in chosen
            if i not in local
        ]
        found = sum(variances_m2[i] * COMPONENTS[i].height_covariance(zeta, zeta) for i in local)
        if columns:
            every = np.hstack(columns)
            found = found + every @ every.T
        return found

    def _between(self, shape, members):
        """c between some sites."""
        if shape == "mean":
            return 1.0
        if len(self.azimuths_rad) == len(self.place) and isinstance(members, slice):
            return self._along[shape]
        place = self.place[members]
        return self._along[shape][place[:, None], place]

    @cached_property
    def _along(self):
        return azimuth_correlations(self.azimuths_rad, self.azimuths_rad, self.nominal_m)
