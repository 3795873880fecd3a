"""At home in python-control 0.10: its own functions on our systems, our methods beside them, and refusals."""

from __future__ import annotations

import copy
import pickle
import warnings

import control as ct
import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest

import susp_ctrl as sc

mpl.use("agg")

PLANT = ct.tf([1, 3], [1, 0.3, 1])
PI = ct.tf([0.06, 0.06], [1, 0])


@pytest.fixture(autouse=True)
def _closed_figures():
    yield
    plt.close("all")


def dead_time_loop():
    """Open loop of the PI controller with dead time, e^{-2.6 s} (s + 3)/(s^2 + 0.3 s + 1) 0.06 (1 + 1/s)."""
    return PLANT * PI * sc.delay(2.6)


def resonant(tau=0.5):
    return ct.tf([1], [1, 0.3, 1], inputs="force", outputs="position") * sc.delay(tau)


def two_by_two():
    G = ct.StateSpace([[-1, 0.5], [0, -2]], np.eye(2), np.eye(2), 0, inputs=["a", "b"], outputs=["p", "q"])
    return sc.feedback(sc.delay(0.4) * G, 0.3)


def value_of(loop, omega):
    s = 1j * np.asarray(omega)
    return np.exp(-2.6 * s) * (s + 3) / (s**2 + 0.3 * s + 1) * 0.06 * (1 + 1 / s)


# -------------------------------------------------------------------------------- python-control's functions


@pytest.mark.analytical
def test_frequency_response_is_exact_data_with_names():
    omega = np.geomspace(0.01, 50, 200)
    for response in (resonant().frequency_response(omega), ct.frequency_response(resonant(), omega)):
        assert isinstance(response, ct.FrequencyResponseData)
        exact = np.exp(-0.5j * omega) / (1 - omega**2 + 0.3j * omega)
        assert response.frdata[0, 0] == pytest.approx(exact, rel=1e-13)
        assert response.input_labels == ["force"]
        assert response.output_labels == ["position"]
    frame = resonant().frequency_response(omega).to_pandas()
    assert len(frame) == 200
    assert ct.frd(resonant(), omega).frdata[0, 0] == pytest.approx(exact, rel=1e-13)
    assert ct.dcgain(resonant()) == pytest.approx(1.0)
    assert ct.evalfr(resonant(), 2j) == pytest.approx(np.exp(-1j) / (-3 + 0.6j))


@pytest.mark.analytical
def test_bode_plot_of_python_control_and_our_own_draw_the_exact_curve():
    omega = np.geomspace(0.05, 20, 400)
    exact = np.exp(-0.5j * omega) / (1 - omega**2 + 0.3j * omega)
    theirs = ct.bode_plot(resonant().frequency_response(omega))
    plt.figure()
    before = plt.gcf()
    ours = resonant().bode_plot(omega)
    assert ours.figure is not before
    assert not before.axes
    for drawn in (theirs, ours):
        magnitude, phase = (axes.get_lines()[0] for axes in drawn.axes.ravel())
        assert magnitude.get_xdata() == pytest.approx(omega)
        assert magnitude.get_ydata() == pytest.approx(np.abs(exact), rel=1e-12)
        assert np.exp(1j * np.radians(phase.get_ydata())) == pytest.approx(exact / np.abs(exact), abs=1e-9)
        # unwrapped: the delay turns on
        assert phase.get_ydata()[-1] == pytest.approx(-180 - np.degrees(0.5 * 20), abs=2)


@pytest.mark.analytical
def test_nyquist_response_counts_the_encirclements():
    """K e^{-s}/(s + 1): critical gain K = sqrt(1 + w^2), w = -tan(w)."""
    omega = np.concatenate([[0.0], np.geomspace(1e-3, 300, 20000)])
    critical = np.sqrt(1 + 2.028757838110434**2)
    for gain, encircled in ((0.98 * critical, 0), (1.02 * critical, 2)):
        L = gain * ct.tf([1], [1, 1]) * sc.delay(1.0)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            response = ct.nyquist_response(L, omega)
        assert response.count == encircled
        assert sc.count_unstable_roots(sc.feedback(L)) == encircled
    drawn = dead_time_loop().nyquist_plot()
    assert drawn.axes.size == 1
    curve = drawn.axes.ravel()[0].get_lines()
    assert any(line.get_xdata().size > 50 for line in curve)


@pytest.mark.analytical
def test_singular_values_of_python_control_are_exact():
    system, omega = two_by_two(), np.geomspace(0.1, 20, 60)
    expected = np.linalg.svd(np.moveaxis(system(1j * omega), -1, 0), compute_uv=False).T
    response = ct.singular_values_response(system, omega)
    assert np.abs(response.frdata[:, 0, :]) == pytest.approx(expected, rel=1e-12)
    drawn = system.singular_values_plot(omega)
    lines = [
        line.get_ydata() for line in drawn.axes.ravel()[0].get_lines() if len(line.get_ydata()) == omega.size
    ]
    assert np.sort([line[0] for line in lines]) == pytest.approx(np.sort(expected[:, 0]), rel=1e-9)


def test_nichols_plot_and_default_frequencies():
    assert resonant().nichols_plot().axes.size == 1
    for system in (
        resonant(),
        two_by_two(),
        dead_time_loop(),
        sc.delay(0.5),
        sc.DelayLTI(ct.ss(-1, 1, 1, 0)),
    ):
        omega = system.frequency_response().omega
        assert np.all(np.diff(omega) > 0)
        values = np.abs(system(1j * omega, squeeze=False)).reshape(-1, omega.size)
        assert np.all(np.isfinite(values))
    # a lightly damped peak is met
    sharp = ct.tf([1], [1, 2e-4, 1]) * sc.delay(0.3)
    omega = sharp.frequency_response().omega
    assert np.abs(sharp(1j * omega)).max() > 0.98 * 5000


# -------------------------------------------------------------------------------------------------- margins


@pytest.mark.literature
def test_margins_of_the_loop_with_dead_time():
    """MathWorks, "Analyzing Control Systems with Delays": gain crossover 0.190 rad/s, delay margin 6.67 s."""
    margins = dead_time_loop().margins()
    assert margins.gain_crossovers["omega"].tolist() == pytest.approx([0.1901470468354], rel=1e-11)
    assert margins.delay_margin == pytest.approx(6.671155629751, abs=1e-9)
    assert str(margins).startswith("gain margin 1.565")


@pytest.mark.analytical
def test_margins_equal_ct_margin_on_dense_data():
    loop = dead_time_loop()
    margins = loop.margins()
    gm, pm, wcg, wcp = ct.margin(loop.frequency_response(np.geomspace(0.01, 20, 20000)))
    assert margins.gain_margin == pytest.approx(gm, rel=1e-6)
    assert np.degrees(margins.phase_margin) == pytest.approx(pm, rel=1e-6)
    assert margins.phase_crossovers["omega"].iloc[0] == pytest.approx(wcg, rel=1e-6)
    assert margins.gain_crossovers["omega"].iloc[0] == pytest.approx(wcp, rel=1e-6)
    for omega in margins.phase_crossovers["omega"]:
        value = value_of(loop, omega)
        assert abs(value.imag) < 1e-12 * abs(value)
        assert value.real < 0


@pytest.mark.analytical
def test_delay_margin_is_the_least_over_all_crossovers_not_that_of_the_smallest_phase_margin():
    """A slow crossover with little phase and a resonance that crosses again far above with more."""
    loop = ct.tf([1.0], [1, 0]) * ct.tf([1], [2.5, 1]) + ct.tf([6.0], [1, 0.2, 400])
    loop = sc.DelayLTI(ct.ss(loop)) * sc.delay(0.002)
    margins = loop.margins()
    crossings = margins.gain_crossovers
    assert len(crossings) == 3
    smallest_phase = crossings.loc[crossings["phase_margin"].abs().idxmin()]
    assert margins.delay_margin == crossings["delay_margin"].min()
    assert margins.delay_margin < 0.5 * smallest_phase["delay_margin"]
    # the closed loop loses stability exactly there
    sys = sc.feedback(loop)
    assert sc.count_unstable_roots(sys) == 0
    assert sc.count_unstable_roots(sc.feedback(loop * sc.delay(0.999 * margins.delay_margin))) == 0
    assert sc.count_unstable_roots(sc.feedback(loop * sc.delay(1.001 * margins.delay_margin))) > 0


@pytest.mark.analytical
def test_margins_of_first_order_loops_in_closed_form():
    """K e^{-s tau}/(s + 1): unit gain at sqrt(K^2 - 1)."""
    K, tau = 2.0, 0.3
    margins = (K * ct.tf([1], [1, 1]) * sc.delay(tau)).margins()
    crossover = np.sqrt(K**2 - 1)
    assert margins.phase_margin == pytest.approx(np.pi - np.arctan(crossover) - tau * crossover, rel=1e-12)
    assert margins.delay_margin == pytest.approx((np.pi - np.arctan(crossover)) / crossover - tau, rel=1e-11)
    omega = margins.phase_crossovers["omega"].iloc[0]
    assert np.arctan(omega) + tau * omega == pytest.approx(np.pi, rel=1e-12)
    assert margins.gain_margin == pytest.approx(np.sqrt(1 + omega**2) / K, rel=1e-12)
    assert margins.complete
    assert not (2 * sc.delay(1.0)).margins((0.1, 10.0)).complete
    none = sc.DelayLTI(ct.ss(ct.tf([0.5], [1, 1]))).margins()
    assert none.gain_margin == none.phase_margin == none.delay_margin == np.inf
    with pytest.raises(sc.InputError, match="one of each"):
        two_by_two().margins()
    with pytest.raises(sc.InputError, match="omega_range"):
        dead_time_loop().margins((2.0, 1.0))


# ------------------------------------------------------------------------------------------ poles and zeros


@pytest.mark.analytical
def test_poles_are_the_rightmost_roots_and_contain_all_unstable_ones():
    closed = sc.feedback(dead_time_loop())
    poles = closed.poles()
    assert poles.size >= 8
    assert poles[:4] == pytest.approx(
        [-0.07979257161823 + 0.8166622028655j, -0.07979257161823 - 0.8166622028655j, -0.2379670538059,
         -1.458957618286 + 2.159294486546j], abs=1e-9)  # fmt: skip
    assert resonant().poles() == pytest.approx([-0.15 + 0.98868600j, -0.15 - 0.98868600j], abs=1e-8)
    many = sc.feedback(60 * ct.tf([1], [1, 1]) * sc.delay(1.0))
    assert np.sum(many.poles().real > 0) == sc.count_unstable_roots(many) > 8
    assert closed.poles(2).size == 2
    wn, zeta, _ = ct.damp(resonant(), doprint=False)
    assert wn == pytest.approx([1, 1])
    assert zeta == pytest.approx([0.15, 0.15])


@pytest.mark.analytical
def test_zeros_of_quasi_polynomials():
    """1 - a e^{-s tau}: s = (ln a + 2 pi j k)/tau; also zeros of a plain plant behind a delay, and of a matrix."""
    zeros = (1 - 0.5 * sc.delay(0.5)).zeros(5)
    k = np.array([0, 1, -1, 2, -2])
    assert zeros == pytest.approx((np.log(0.5) + 2j * np.pi * k) / 0.5, rel=1e-8)
    assert dead_time_loop().zeros() == pytest.approx([-1.0, -3.0], abs=1e-9)
    assert resonant().zeros().size == 0
    system = 1 + sc.delay(1.0) * ct.tf([1], [1, 1])
    # zeros of s + 1 + e^{-s}: the roots of x' = -x - x(t - 1)
    roots = sc.characteristic_roots(sc.DelayLTI.from_state_delays([[[-1.0]], [[-1.0]]], [1.0]), 6)
    assert system.zeros(6) == pytest.approx(roots, abs=1e-8)
    matrix = sc.append(system, ct.tf([1, 2.5], [1, 4]))
    assert np.min(np.abs(matrix.zeros(10) + 2.5)) < 1e-8
    with pytest.raises(sc.InputError, match="as many"):
        two_by_two()["p", :].zeros()


# --------------------------------------------------------------------------------------------- time response


@pytest.mark.literature
def test_step_response_of_the_closed_loop_with_dead_time():
    """MathWorks, same page; values recomputed to 1e-8 in an independent solver."""
    times = np.array([0.0, 2.5, 2.6, 5, 8, 10, 15, 20, 40])
    response = sc.feedback(dead_time_loop()).step_response(times)
    assert isinstance(response, ct.TimeResponseData)
    expected = [0, 0, 0.0, 0.6387152221434, 0.9691802042535, 0.7158814718357, 1.097337620099, 0.9628870276495]
    assert response.outputs == pytest.approx([*expected, 0.9936426307902], abs=1e-8)


@pytest.mark.literature
def test_step_and_impulse_of_the_delayed_integrator_loop():
    """ControlSystems.jl, test_delay_timeresp.jl: feedback(delay(1) K/s), K = 2, by the method of steps."""
    loop = sc.feedback(2 * sc.delay(1.0) * ct.tf([1], [1, 0]))
    times = np.array([0.0, 0.5, 1.5, 2.0, 2.5, 3.0])
    assert loop.step_response(times).outputs == pytest.approx([0, 0, 1, 2, 2.5, 2], abs=1e-11)
    times = np.array([0.0, 0.5, 1.5, 2.5, 3.0])
    assert loop.impulse_response(times).outputs == pytest.approx([0, 0, 2, 0, -2], abs=1e-11)


@pytest.mark.analytical
def test_impulse_responses_in_closed_form():
    times = np.linspace(0.0, 4.0, 81)
    lag = ct.tf([1], [1, 1])
    late = np.where(times >= 0.5, np.exp(-(times - 0.5)), 0.0)
    for system in (lag * sc.delay(0.5), sc.delay(0.5) * lag):
        assert system.impulse_response(times).outputs == pytest.approx(late, abs=1e-10)
    # an impulse that passes directly is left out, as python-control does
    assert (lag * sc.delay(0.5) + sc.delay(1.0)).impulse_response(times).outputs == pytest.approx(
        late, abs=1e-10
    )
    plain = ct.impulse_response(ct.tf([1], [1, 0.3, 1]), times).outputs
    assert sc.DelayLTI(ct.ss(ct.tf([1], [1, 0.3, 1]))).impulse_response(times).outputs == pytest.approx(
        plain, abs=1e-8
    )


@pytest.mark.analytical
def test_traces_and_forced_response():
    system = two_by_two()
    times = np.linspace(0, 3, 31)
    steps = system.step_response(times)
    assert steps.outputs.shape == (2, 2, 31)
    assert steps.output_labels == ["p", "q"]
    for j, name in enumerate(["a", "b"]):
        alone = system.forced_response(times, {name: 1.0})
        assert np.asarray(steps.outputs[:, j]) == pytest.approx(np.asarray(alone.outputs), abs=1e-9)
    assert resonant().step_response().time[-1] > 7 / 0.15
    assert resonant().step_response(12.0).time[-1] == 12.0
    assert steps.plot() is not None
    free = sc.DelayLTI(ct.ss(-1, 1, 1, 0)).initial_response(times, [2.0])
    assert np.asarray(free.outputs) == pytest.approx(2 * np.exp(-times), abs=1e-8)


# ---------------------------------------------------------------------------------------- nothing is lost


@pytest.mark.parametrize(
    "conversion",
    [
        ct.ss,
        ct.tf,
        ct.ss2tf,
        ct.tf2ss,
        ct.StateSpace,
        ct.TransferFunction,
        ct.ssdata,
        ct.tfdata,
        ct.minreal,
        lambda s: ct.c2d(s, 0.1),
        lambda s: ct.sample_system(s, 0.1),
        lambda s: ct.append(ct.tf([1], [1, 1]), s),
        lambda s: ct.feedback(ct.tf([1], [1, 1]), s),
        lambda s: ct.interconnect([s], inputs=["force"], outputs=["position"]),
        lambda s: ct.combine_tf([[s]]),
        lambda s: ct.step_response(s, [0.0, 1.0]),
        lambda s: ct.forced_response(s, [0.0, 1.0], [1.0, 1.0]),
        lambda s: ct.impulse_response(s, [0.0, 1.0]),
        lambda s: ct.initial_response(s, [0.0, 1.0]),
        lambda s: ct.norm(s),
        lambda s: s.to_ss(),
        lambda s: s.to_tf(),
    ],
)
def test_no_conversion_loses_the_delay_silently(conversion):
    """Each of these needs matrices or polynomials: it must fail, never return a system without the delay."""
    with pytest.raises(
        (TypeError, ValueError, AttributeError, NotImplementedError, ct.ControlNotImplemented)
    ):
        conversion(resonant())


def test_a_copy_is_the_same_system():
    for twin in (copy.deepcopy(resonant()), resonant().copy("twin"), pickle.loads(pickle.dumps(resonant()))):
        assert twin(0.7j) == resonant()(0.7j)
        assert twin.input_labels == ["force"]


@pytest.mark.analytical
def test_conversion_without_working_delay_is_exact():
    G = ct.tf([1, 2], [1, 0.3, 1])
    for system in (
        G * sc.delay(0.0),
        (G * sc.delay(0.7)).with_delays([0.0]),
        sc.parallel(G, G * sc.delay(0.7)).with_gains([0.0]),
    ):
        s = np.array([0.3j, 1 + 2j])
        assert isinstance(system.to_ss(), ct.StateSpace)
        assert system.to_ss()(s) == pytest.approx(G(s), rel=1e-12)
        assert isinstance(system.to_tf(), ct.TransferFunction)
        assert system.to_tf()(s) == pytest.approx(G(s), rel=1e-9)
    with pytest.raises(sc.InputError, match=r"pade\(order\)"):
        resonant().to_ss()
