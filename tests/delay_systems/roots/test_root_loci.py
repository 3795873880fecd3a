"""Root loci over delays and gains: closed forms, branches, counts."""

from __future__ import annotations

import warnings

import control
import numpy as np
import pytest
import scipy.special
from delay_cases import rows, system

import susp_ctrl as sc
from susp_ctrl.errors import InputError


@pytest.mark.analytical
def test_branch_over_a_delay_is_the_lambert_function():
    """x' = -x(t - tau): s = W_0(-tau)/tau, a smooth path behind tau = 1/e; crossing at pi/2."""
    values = np.linspace(0.5, 3.0, 101)
    locus = sc.root_locus(system("x_prime_minus_x_delayed"), "delay[0]", values, count=2)
    expected = scipy.special.lambertw(-values) / values
    leading = locus.roots[:, 0]
    assert not np.any(np.isnan(leading))
    np.testing.assert_allclose(leading, np.where(expected.imag < 0, expected.conj(), expected), rtol=1e-10)
    np.testing.assert_array_equal(locus.unstable_roots, np.where(values > np.pi / 2, 2, 0))
    np.testing.assert_allclose(locus.abscissa, expected.real, rtol=1e-10, atol=1e-14)


@pytest.mark.analytical
def test_over_a_gain_and_over_factors():
    """x' = g x(t - 1): s = W(g). A factor on all gains does the same here."""
    loop = system("x_prime_minus_x_delayed").with_gains([2.0])
    values = np.linspace(0.5, 1.9, 15)
    over_gain = sc.root_locus(loop, "gain[0]", values, count=1)
    expected = scipy.special.lambertw(-values)
    np.testing.assert_allclose(over_gain.abscissa, expected.real, rtol=1e-10)
    by_factor = sc.root_locus(loop, "gains", values / 2.0, count=1)
    np.testing.assert_allclose(by_factor.abscissa, expected.real, rtol=1e-10)
    slower = sc.root_locus(loop.with_gains([1.0]), "delays", values, count=1)
    np.testing.assert_allclose(slower.abscissa, (expected / values).real, rtol=1e-10)


@pytest.mark.literature
def test_counts_along_a_delay():
    """Stability switches of delay_cases.json, case delayed_oscillator_gkc_p193."""
    for case, row in (p.values for p in rows("unstable_root_count_intervals")):
        if case["id"] == "delayed_oscillator_gkc_p193":
            values = np.linspace(0.0, 12.0, 100)
            locus = sc.root_locus(system(case), "delay[0]", values, count=4)
            for low, high, number in row["value"]:
                inside = (values > low) & (values < high)
                np.testing.assert_array_equal(locus.unstable_roots[inside], number)
            return
    raise AssertionError("the case is missing")


def test_printed_tabulated_and_drawn():
    locus = sc.root_locus(system("x_prime_minus_x_delayed"), "delay[0]", [1.0, 1.5, np.pi / 2, 2.0], count=2)
    assert locus.unstable_roots.tolist() == [0, 0, -1, 2]
    assert "delay[0] = 2: 2 unstable roots" in str(locus)
    table = locus.to_pandas()
    assert list(table.columns) == ["delay[0]", "branch", "real", "imaginary"]
    assert len(table) == np.sum(~np.isnan(locus.roots))
    from matplotlib.figure import Figure

    ax = Figure().subplots()
    assert locus.plot(ax) is ax
    assert len(ax.lines) >= 2 * locus.roots.shape[1]


@pytest.mark.parametrize(
    ("parameter", "values", "words"),
    [
        ("delay", [0.0, 1.0], "parameter"),
        ("delay[1]", [0.0, 1.0], "parameter"),
        ("delay[0]", [-1.0, 1.0], "at least 0"),
        ("gain[0]", [1.0, 1.0], "increase"),
        ("gain[0]", [], "empty"),
    ],
)
def test_bad_input_is_named(parameter, values, words):
    with pytest.raises(InputError, match=words):
        sc.root_locus(system("x_prime_minus_x_delayed"), parameter, values)


def test_a_root_at_zero_gives_no_warning():
    """Without gain the integrator is open: its only root lies at zero."""
    loop = sc.feedback(sc.delay(0.5) * control.tf([1.0], [1.0, 0.0]), 1)
    with warnings.catch_warnings(action="error"):
        locus = sc.root_locus(loop, "gain[0]", np.linspace(-2.0, 2.0, 11))
    assert locus.roots.shape[0] == 11
