"""Disk margins, margins of one channel among several, and what is refused."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

import susp_ctrl as sc

s = ct.tf("s")


def two_channels() -> sc.DelayLTI:
    plant = ct.ss([[-1.0, 0.4], [-0.3, -2.0]], np.eye(2), [[2.0, 0.5], [1.0, 3.0]], np.zeros((2, 2)))
    delayed = sc.append(sc.delay(0.2), sc.delay(0.1))
    return (sc.DelayLTI.of(plant) * delayed).with_names(inputs=["front", "rear"])


@pytest.mark.analytical
@pytest.mark.parametrize("channel", [0, 1])
def test_a_channel_is_broken_with_the_others_closed(channel):
    loop, other = two_channels(), 1 - channel
    margins = loop.margins(channel=["front", "rear"][channel])
    for omega in margins.gain_crossovers["omega"]:
        L = loop(1j * omega)
        L = L[channel, channel] - L[channel, other] * L[other, channel] / (1 + L[other, other])
        assert abs(L) == pytest.approx(1.0, rel=1e-10)
    # at the gain margin the closed loop has a root on the axis
    factor = np.ones(2)
    factor[channel] = margins.gain_range[1]
    assert sc.spectral_abscissa(sc.feedback(loop * np.diag(factor))) == pytest.approx(0.0, abs=1e-8)
    assert margins.complete


@pytest.mark.property
@pytest.mark.parametrize("channel", [0, 1])
def test_loop_without_static_gain_and_with_two_delays(channel):
    """Wheel displacement to actuator force of the half car: the value at zero frequency is rounding and no more."""
    pairs = [("front", 19345.0, 0.5530), ("rear", 26150.0, 0.5186)]
    channels = [
        sc.FeedbackChannel(f"unsprung_displacement_{k}", f"force_{k}", gain=g, delay=tau)
        for k, g, tau in pairs
    ]
    loop = sc.open_loop(sc.HalfCar().plant(), channels)
    omega = np.linspace(0.5, 150.0, 300_001)
    L = _broken(loop, channel, omega)
    crossing = (L[1:].imag * L[:-1].imag < 0) & (L[1:].real < 0)
    margins = loop.margins(channel=channel)
    assert margins.gain_margin == pytest.approx(1 / np.abs(L[1:][crossing]).max(), rel=1e-4)
    assert margins.complete


@pytest.mark.analytical
@pytest.mark.parametrize("skew", [0.0, 1.0, -1.0, 0.5])
def test_disk_margin_equals_python_control_without_delay(skew):
    loop = ct.tf([25.0], [1, 10, 10, 10])
    disk = sc.disk_margin(loop, skew)
    omega = np.sort(np.append(np.geomspace(1e-2, 1e2, 500), disk.omega))
    margin, gain_db, phase = ct.disk_margins(ct.ss(loop), omega, skew=skew)
    assert disk.margin == pytest.approx(margin, rel=1e-9)
    assert disk.phase_margin_deg == pytest.approx(phase, rel=1e-9)
    assert 20 * np.log10(min(disk.gain_range[1], 1 / disk.gain_range[0])) == pytest.approx(gain_db, rel=1e-9)


@pytest.mark.analytical
def test_disk_margin_with_delay_lies_within_the_classical_margins():
    loop = sc.DelayLTI.of(2 / (s + 1)) * sc.delay(0.3)
    disk, margins = loop.disk_margin(), loop.margins()
    omega = np.geomspace(1e-2, 1e2, 20_000)
    L = loop(1j * omega)
    assert 1 / disk.margin == pytest.approx(np.abs(0.5 * (1 - L) / (1 + L)).max(), rel=1e-6)
    assert disk.phase_margin <= abs(margins.phase_margin)
    assert disk.gain_range[1] <= margins.gain_range[1]
    coupled = two_channels().disk_margin()
    assert coupled.margin <= min(
        1 / np.abs(0.5 * (1 - L) / (1 + L)).max()
        for L in (two_channels()[k, k](1j * omega) * 0 + _broken(two_channels(), k, omega) for k in (0, 1))
    ) * (1 + 1e-6)


def _broken(loop: sc.DelayLTI, k: int, omega: np.ndarray) -> np.ndarray:
    L, o = loop(1j * omega), 1 - k
    return L[k, k] - L[k, o] * L[o, k] / (1 + L[o, o])


def test_a_band_is_no_proof_and_bad_arguments_are_named():
    loop = sc.DelayLTI.of(2 / (s + 1)) * sc.delay(0.3)
    inside = loop.margins((1.0, 3.0))
    assert not inside.complete
    assert "not proven" in str(inside)
    assert inside.gain_crossovers["omega"].tolist() == pytest.approx([np.sqrt(3)])
    assert loop.margins((2.0, 3.0)).gain_crossovers.empty
    with pytest.raises(sc.InputError, match="one of each"):
        two_channels().margins()
    with pytest.raises(sc.InputError, match="channel = 'middle'"):
        two_channels().margins(channel="middle")
    with pytest.raises(sc.InputError, match="as many of both"):
        two_channels()[0, :].disk_margin()
    with pytest.raises(sc.UnstableSystemError):
        sc.disk_margin(0.5 / (s - 1))


@pytest.mark.analytical
@pytest.mark.parametrize(
    ("gain", "expected"), [(0.5, 2.0 * np.arctan(3.0)), (3.0, 2.0 * np.arctan(2.0)), (1.0, np.inf)]
)
def test_angles_beyond_a_right_angle(gain, expected):
    """L = k: (S - T)/2 = (1 - k)/(1 + k)/2, and the angle 2 atan(alpha/2) also where the disk holds a half plane."""
    assert sc.disk_margin(ct.tf([gain], [1.0])).phase_margin == pytest.approx(expected)


@pytest.mark.analytical
@pytest.mark.parametrize("T", [1e-9, 1e-5, 1.0, 1e6])
def test_norms_do_not_depend_on_the_unit_of_time(T):
    lag = sc.delay(T) * ct.tf([1.0], [T, 1.0])
    assert sc.hinf_norm(lag)[0] == pytest.approx(1.0, rel=1e-8)
    norm, omega = sc.hinf_norm(sc.feedback(1, sc.delay(T) * ct.tf([1.0], [T, 0.0])))
    assert norm == pytest.approx(3.12931160049, rel=1e-9)
    assert omega * T == pytest.approx(1.38238669, rel=1e-6)
