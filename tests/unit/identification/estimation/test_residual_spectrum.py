"""Local spectra: variances that cover with coloured noise, and their degrees of freedom."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from scipy.signal import lfilter

from armload_identification.estimation.payload_intervals import student_half_width
from armload_identification.estimation.residual_spectrum import FREEST, ResidualSpectrum

pytestmark = pytest.mark.pure

SAMPLES = 400


@pytest.fixture(scope="module")
def basis():
    """(400, 2, 4) orthonormal columns with their power at the lowest frequencies, as of a motion under gravity."""
    place = np.arange(SAMPLES) / SAMPLES
    waves = [trig(2.0 * np.pi * k * place + k) for k in (1, 2, 3, 5) for trig in (np.sin, np.cos)]
    rng = np.random.default_rng(3)
    columns = np.array(waves).T @ rng.normal(size=(8, 2 * 4))
    return np.linalg.qr(columns.reshape(SAMPLES, 2, 4).reshape(-1, 4))[0].reshape(SAMPLES, 2, 4)


def white(rng):
    return rng.normal(size=(SAMPLES, 2))


def slow(rng):
    """White noise through an exponential memory of ten samples, of unit variance."""
    decay = np.exp(-0.1)
    drive = np.sqrt(1.0 - decay**2) * rng.normal(size=(SAMPLES + 200, 2))
    return lfilter([1.0], [1.0, -decay], drive, axis=0)[200:]


def fitted(basis, noise):
    """Coefficients of the basis and the spectrum of what is left."""
    found = np.tensordot(basis, noise, axes=([0, 1], [0, 1]))
    return found, ResidualSpectrum(basis, noise - basis @ found, np.ones((SAMPLES, 2)))


@pytest.mark.parametrize(
    ("noise", "least", "textbook"), [(white, 0.92, 0.97), (slow, 0.90, 0.5)], ids=["white", "slow"]
)
def test_intervals_cover_whatever_the_colour(basis, noise, least, textbook):
    """The slow noise has 3.5 to 4.4 times the deviation of white noise in the five lowest bins."""
    covered, naive = [], []
    for seed in range(400):
        found, spectrum = fitted(basis, noise(np.random.default_rng(seed)))
        half = student_half_width(spectrum.freedom(np.eye(4))) * np.sqrt(spectrum.variance(np.eye(4)))
        covered.append(np.abs(found) <= half)
        naive.append(np.abs(found) <= 1.96)
    assert least <= np.mean(covered) <= 0.98, np.mean(covered)
    assert np.mean(naive) < textbook


def test_the_freedom_is_that_by_which_the_variances_scatter(basis):
    """Of a variance estimate with f degrees of freedom the relative variance is 2 / f."""
    found = [fitted(basis, white(np.random.default_rng(seed)))[1] for seed in range(400)]
    variance = np.array([spectrum.variance(np.eye(4)) for spectrum in found])
    freedom = np.array([spectrum.freedom(np.eye(4)) for spectrum in found])
    scatter = 2.0 * variance.mean(axis=0) ** 2 / variance.var(axis=0)
    np.testing.assert_allclose(np.median(freedom, axis=0), scatter, rtol=0.35)


def test_the_freedom_of_a_matrix_is_that_of_a_wishart_matrix(basis):
    found = [fitted(basis, white(np.random.default_rng(seed)))[1] for seed in range(400)]
    matrices = np.array([spectrum.covariance() for spectrum in found])
    root = np.linalg.inv(np.linalg.cholesky(matrices.mean(axis=0)))
    scatter = np.mean(np.sum((root @ matrices @ root.T - np.eye(4)) ** 2, axis=(1, 2)))
    reported = 1.0 / np.mean([1.0 / spectrum.joint_freedom(np.eye(4), spectrum.covariance()) for spectrum in found])
    # The elements of a Wishart matrix of f degrees of freedom and mean 1 have k (k + 1) / f as sum of their variances.
    assert 0.6 <= reported * scatter / 20.0 <= 1.6, (reported, 20.0 / scatter)


def test_what_the_fit_absorbed_is_restored(basis):
    """As many coefficients as the low bins hold: what is left there is small, the variance is not."""
    place = np.arange(SAMPLES) / SAMPLES
    waves = np.array([trig(2.0 * np.pi * k * place) for k in (3, 4, 5, 6) for trig in (np.sin, np.cos)]).T
    full = np.ascontiguousarray(waves / np.sqrt(np.sum(waves**2, axis=0)))[:, None, :]
    variances = []
    for seed in range(100):
        noise = np.random.default_rng(seed).normal(size=(SAMPLES, 1))
        found = np.tensordot(full, noise, axes=([0, 1], [0, 1]))
        spectrum = ResidualSpectrum(full, noise - full @ found, np.ones((SAMPLES, 1)))
        variances.append(spectrum.variance(np.eye(8)))
    assert 0.9 <= np.mean(variances) <= 1.6, np.mean(variances)


def test_rows_without_weight_raise_the_level(basis):
    """Half of the rows excluded, in blocks: the spectrum of the others counts twice."""
    used = (np.arange(SAMPLES) // 20 % 2 == 0)[:, None] * np.ones((1, 2))
    gated = np.linalg.qr((basis * used[:, :, None]).reshape(-1, 4))[0].reshape(basis.shape)
    variances = []
    for seed in range(100):
        noise = white(np.random.default_rng(seed)) * used
        found = np.tensordot(gated, noise, axes=([0, 1], [0, 1]))
        variances.append(ResidualSpectrum(gated, noise - gated @ found, used).variance(np.eye(4)))
    assert 0.85 <= np.mean(variances) <= 1.25, np.mean(variances)


def test_a_residual_of_zero_has_no_variance_and_all_freedom(basis):
    spectrum = ResidualSpectrum(basis, np.zeros((SAMPLES, 2)), np.ones((SAMPLES, 2)))
    np.testing.assert_array_equal(spectrum.variance(np.eye(4)), 0.0)
    np.testing.assert_array_equal(spectrum.freedom(np.eye(4)), FREEST)


def test_bins_without_the_motion_are_left_out(basis):
    """It is in bins 1 to 5 of 201; those of the widest window are kept on either side."""
    spectrum = ResidualSpectrum(basis, white(np.random.default_rng(1)), np.ones((SAMPLES, 2)))
    assert len(spectrum._power_along(np.eye(4))) == 5 + 2 * 8


def test_memory_grows_with_the_samples_and_not_with_their_square():
    """37,000 rows of an aperiodic run took 5.8 GB; white rows keep every bin."""
    rng = np.random.default_rng(9)
    samples = 37_000
    basis, _ = np.linalg.qr(rng.normal(size=(samples * 2, 3)))
    tracemalloc.start()
    spectrum = ResidualSpectrum(basis.reshape(samples, 2, 3), rng.normal(size=(samples, 2)), np.ones((samples, 2)))
    freedom = spectrum.freedom(np.eye(3))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 100e6
    np.testing.assert_allclose(np.diag(spectrum.covariance()), 1.0, rtol=0.1)
    # Two joints of about 18,500 equal bins, each with two degrees of freedom.
    assert (freedom > 10_000).all()


def test_white_noise_that_a_fit_mostly_takes_up_is_restored_without_an_excess():
    """Half of all rows are taken up: the variance for any noise is too great by a fifth or more, for white noise it is
    right."""
    rng = np.random.default_rng(8)
    basis, _ = np.linalg.qr(rng.normal(size=(80, 40)))
    white, coloured = [], []
    for _ in range(400):
        noise = rng.normal(size=80)
        spectrum = ResidualSpectrum(basis[:, None], (noise - basis @ (basis.T @ noise))[:, None], np.ones((80, 1)))
        white.append(spectrum.variance(np.eye(40), white=True))
        coloured.append(spectrum.variance(np.eye(40)))
    assert np.mean(white) == pytest.approx(1.0, abs=0.05)
    assert np.mean(coloured) > 1.2
