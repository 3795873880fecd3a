"""The audit against numbers worked out here, from the printed ones and from eq. (1)."""

from __future__ import annotations

import numpy as np
import oracles
import pytest
from scipy.integrate import solve_ivp, trapezoid

from susp_ctrl.errors import InputError
from susp_ctrl.study import compute_study
from susp_ctrl.study.audit.rows import EXPLAINED, NOT_REPRODUCED, REPRODUCED, agrees, compared
from susp_ctrl.study.settings.audit import printed_number

# Orders are low on purpose, to be quick.
pytestmark = pytest.mark.filterwarnings("ignore::susp_ctrl.errors.PadeOrderWarning")

# Eq. (15) of K. Wu, C. Ren, Shock and Vibration, 2020, as printed; one of each conjugate pair.
EQ_15 = [
    complex(-2.0267857911405181608535831306952, 17.090553240960446610326055558861),
    complex(-18.708774367416789822443106075043, 70.205741985817738371855015300647),
    complex(-37.274143773467233351129630918096, 61.657802483584587870216137245193),
    complex(-2.1213896670092750906944528230251, 7.2731773377804970851980013939354),
]
# Table 2, passive column, as printed.
TABLE_2_PASSIVE = [3.0647, 2.3646, 0.0383, 0.0772, 0.0108, 9.7508e-4]
LAG = 2.76 / 20.0


def rows(run, item):
    table = run.audit.table
    return table[table["item"] == item].set_index("where")


def misprinted_matrix():
    """The state matrix of eq. (8)-(9) as it must have been when eq. (15) was computed, entry by entry."""
    m, inertia, mtf, ktf, ksf, ksr, lf, lr, c = (
        690.0,
        1200.0,
        40.5,
        192000.0,
        17000.0,
        22000.0,
        1.25,
        1.51,
        1500.0,
    )
    a = np.zeros((8, 8))
    a[[0, 2, 4, 6], [1, 3, 5, 7]] = 1.0
    a[1] = np.array([-(ksf + ktf), -2 * c, 0, 0, ksf, c, -lf * ksf, +lf * c]) / mtf
    a[3] = np.array([0, 0, -(ksr + ktf), -c, ksr, -c, lr * ksr, lr * c]) / mtf
    a[5] = np.array([ksf, c, ksr, c, -(ksf + ktf), -2 * c, lf * ksf - lr * ksr, (lf - lr) * c]) / m
    pitch = lf**2 * ksf + lr**2 * ksr
    a[7] = np.array(
        [
            -lf * ksf,
            -lf * c,
            lr * ksr,
            lr * c,
            lf * ksf - lr * ksr,
            (lf - lr) * c,
            -pitch,
            -(lf**2 + lr**2) * c,
        ]
    )
    a[7] /= inertia
    a[[1, 3, 5, 7], 0] += np.array([2 / m, (lr - lf) / inertia, -1 / mtf, -1 / mtf])
    return a


def newton_correction(matrix, root):
    """Distance of a number from the nearest eigenvalue, from the characteristic polynomial."""
    coefficients = np.poly(matrix)
    return abs(np.polyval(coefficients, root) / np.polyval(np.polyder(coefficients), root))


@pytest.mark.literature
@pytest.mark.parametrize("root", EQ_15)
def test_the_misprints_give_eq_15_to_all_digits(root):
    """Tolerance: what double precision leaves of the 32 printed digits."""
    assert newton_correction(misprinted_matrix(), root) < 1e-12 * abs(root)


@pytest.mark.literature
def test_eq_15_is_explained_and_the_true_roots_stand_beside_it(small_run):
    roots = small_run.audit.roots
    misprinted = roots["misprint_real"] + 1j * roots["misprint_imaginary"]
    assert np.abs(misprinted.to_numpy() - np.array(EQ_15)).max() < 1e-11
    true = roots["true_real"] + 1j * roots["true_imaginary"]
    for root in true:
        # det Z(s)/s^8 is about 1 at these frequencies, and its slope about 1/s
        assert abs(oracles.characteristic_function(root, gains=(19345.0, 26150.0))) < 1e-9 * abs(root) ** 8
    expected = [-18.9471 + 71.8461j, -17.1799 + 69.8619j, -1.6223 + 6.1111j, -1.8646 + 7.5440j]
    assert np.sort_complex(np.round(true.to_numpy(), 4)) == pytest.approx(
        np.sort_complex(expected), abs=1e-12
    )
    assert set(rows(small_run, "eq. (15)")["verdict"]) == {EXPLAINED}
    assert len(rows(small_run, "eq. (15)")) == 8


def test_without_the_named_misprints_eq_15_is_not_reproduced(main_study):
    study = main_study.with_changes({"audit.roots[1].substitutions": []})
    run = compute_study(study, sections=["audit"])
    assert set(rows(run, "eq. (15)")["verdict"]) == {NOT_REPRODUCED}
    assert run.audit.roots["misprint_real"].isna().all()


def test_a_misprint_too_few_explains_nothing(main_study):
    printed = [dict(s) for s in main_study.table["audit"]["roots"][0]["substitutions"]][1:]
    run = compute_study(
        main_study.with_changes({"audit.roots[1].substitutions": printed}), sections=["audit"]
    )
    assert EXPLAINED not in set(rows(run, "eq. (15)")["verdict"])


def test_a_wrong_correct_entry_is_refused(main_study):
    study = main_study.with_changes({"audit.roots[1].substitutions[1].correct": "csf/mtf"})
    with pytest.raises(InputError, match=r"A\(2, 2\) = csf/mtf"):
        compute_study(study, sections=["audit"])


@pytest.mark.literature
def test_stability_intervals_are_not_reproduced(small_run):
    for item, printed in (("section 4, random design", 0.6312), ("section 4, harmonic design", 0.5817)):
        row = rows(small_run, item).loc["upper end of the stable interval"]
        assert row["published"] == printed
        assert row["computed"] == np.inf
        assert row["verdict"] == NOT_REPRODUCED
        assert "0.4441" in row["evidence"]
    crossings = rows(small_run, "section 4, random design").loc[["crossing frequency"]]
    assert list(crossings["published"]) == [20.7651, 20.7653]
    assert crossings["computed"].isna().all()
    # 0.6312 - 2 pi/20.7651 and 0.6312 - 4 pi/20.7651
    assert "0.3286 and 0.0260" in " ".join(crossings["evidence"]).replace(
        "0.0260 and 0.3286", "0.3286 and 0.0260"
    )


@pytest.mark.literature
@pytest.mark.parametrize(
    ("indicator", "implied", "verdict"),
    [
        ("body_acceleration", -83.60, REPRODUCED),
        ("pitch_acceleration", -52.80, REPRODUCED),
        ("suspension_deflection_front", -28.20, EXPLAINED),
        ("suspension_deflection_rear", -53.11, EXPLAINED),
        ("tire_deflection_front", -81.48, REPRODUCED),
        ("tire_deflection_rear", -65.78, EXPLAINED),
    ],
)
def test_percentages_of_table_2(small_run, indicator, implied, verdict):
    """Three printed percentages do not follow from the printed entries beside them."""
    row = rows(small_run, "Table 2, percentages").loc[f"{indicator}, from the printed entries"]
    assert row["computed"] == pytest.approx(implied, abs=0.006)
    assert row["verdict"] == verdict


@pytest.mark.literature
def test_percentages_of_table_3_follow_from_its_entries(small_run):
    table = rows(small_run, "Table 3, percentages")
    from_entries = table[table.index.str.endswith("from the printed entries")]
    assert len(from_entries) == 6
    assert set(from_entries["verdict"]) == {REPRODUCED}


@pytest.mark.literature
def test_peak_of_the_passive_car_is_not_at_5_9_hz(small_run):
    omega = np.linspace(6.0, 9.0, 30001)
    heave = oracles.displacement_response(1j * omega)[:, 2]
    in_phase = omega[np.argmax(omega * np.abs(heave.sum(axis=-1)))] / (2 * np.pi)
    row = rows(small_run, "section 3, Fig. 2").iloc[0]
    assert row["computed"] == pytest.approx(in_phase, abs=2e-5)
    assert row["verdict"] == NOT_REPRODUCED
    assert "7.427 rad/s" in row["evidence"]


def passive_rms(duration, step):
    """RMS of the passive car on 0.05 sin(7 t), from eq. (1) integrated by scipy; rear wheel LAG later."""
    z = [oracles.dynamic_stiffness(np.array(s)) for s in (0.0, 1.0, -1.0)]
    stiffness = z[0].real
    damping = (z[1] - z[2]).real / 2
    mass = (z[1] + z[2]).real / 2 - stiffness
    tire = 192000.0

    def road(t):
        return 0.05 * np.array([np.sin(7 * t), np.sin(7 * (t - LAG)) if t > LAG else 0.0])

    def acceleration(t, q, v):
        return np.linalg.solve(mass, np.append(tire * road(t), [0, 0]) - damping @ v - stiffness @ q)

    def slope(t, x):
        return np.append(x[4:], acceleration(t, x[:4], x[4:]))

    first = solve_ivp(slope, (0, LAG), np.zeros(8), rtol=1e-9, atol=1e-12, dense_output=True)
    second = solve_ivp(slope, (LAG, duration), first.y[:, -1], rtol=1e-9, atol=1e-12, dense_output=True)
    times = np.arange(round(duration / step) + 1) * step
    states = np.where(times < LAG, first.sol(times), second.sol(times))
    q, v = states[:4], states[4:]
    roads = np.array([road(t) for t in times]).T
    a = np.array([acceleration(t, q[:, k], v[:, k]) for k, t in enumerate(times)]).T
    outputs = [
        a[2],
        a[3],
        q[2] - 1.25 * q[3] - q[0],
        q[2] + 1.51 * q[3] - q[1],
        q[0] - roads[0],
        q[1] - roads[1],
    ]
    return np.sqrt(trapezoid(np.square(outputs), times, axis=1) / duration)


def test_table_2_passive_against_a_simulation_of_eq_1(small_run):
    table = rows(small_run, "Table 2")
    passive = table[table.index.str.endswith(", passive")]
    assert list(passive["published"]) == TABLE_2_PASSIVE
    assert passive["computed"].to_numpy() == pytest.approx(passive_rms(3.0, 0.002), rel=1e-6)
    assert NOT_REPRODUCED in set(passive["verdict"])


@pytest.mark.literature
def test_stationary_values_of_table_2(small_run):
    """Restated paper: 3.6408, 0.4022, 0.0649, 0.0506, 0.0069, 0.0068; and from the 4 x 4 equations, active too."""
    rms = small_run.time[0].rms
    stationary = rms[rms["method"] == "stationary"].set_index(["design", "indicator"])["value"]
    designs = {"passive": ((0, 0), (0, 0)), "harmonic_published": ((29653, -4416), (0.3255, 0.5438))}
    for design, (gains, delays) in designs.items():
        response = oracles.ride_response(7j, gains, delays)[:6] @ np.array([1.0, np.exp(-7j * LAG)])
        assert stationary[design].to_numpy() == pytest.approx(0.05 / np.sqrt(2) * np.abs(response), rel=1e-10)
    assert list(np.round(stationary["passive"], 4)) == [3.6408, 0.4022, 0.0649, 0.0506, 0.0069, 0.0068]


@pytest.mark.literature
def test_stationary_values_of_the_random_road(small_run):
    """Class C at 20 m/s, passive: 0.9291, 0.7078, 0.0116, 0.0112, 0.0040, 0.0042."""
    rms = small_run.time[1].rms
    passive = rms[(rms["method"] == "stationary") & (rms["design"] == "passive")]["value"]
    assert list(np.round(passive, 4)) == [0.9291, 0.7078, 0.0116, 0.0112, 0.0040, 0.0042]


def test_a_number_that_agrees_is_reproduced(main_study, small_study):
    """The verdict follows the numbers: print what is computed, and it is reproduced."""
    computed = passive_rms(3.0, 0.002)[0]
    study = small_study.with_changes({"audit.tables[1].rows[1].passive": f"{computed:.4f}"})
    run = compute_study(study, sections=["time", "audit"])
    assert rows(run, "Table 2").loc["body_acceleration, passive", "verdict"] == REPRODUCED


def test_summary_counts_every_row_once(small_run):
    table, summary = small_run.audit.table, small_run.audit.summary
    counts = summary.set_index("item")
    assert counts.loc["all"].sum() == len(table)
    assert counts.drop("all").to_numpy().sum() == len(table)
    assert counts.loc["all", "explained"] == 8 + 3


@pytest.mark.parametrize(
    ("text", "value", "half_digit"),
    [
        ("0.5026", 0.5026, 5e-5),
        ("9.7508e-4", 9.7508e-4, 5e-9),
        ("-83.60", -83.6, 5e-3),
        ("29653", 29653.0, 0.5),
    ],
)
def test_printed_numbers(text, value, half_digit):
    printed = printed_number(text)
    assert printed.value == value
    assert printed.half_digit == pytest.approx(half_digit)


@pytest.mark.parametrize(
    ("text", "computed", "verdict"),
    [
        ("0.0020", 0.00205, REPRODUCED),
        ("0.0020", 0.00206, NOT_REPRODUCED),
        ("3.0647", 3.0647 * 1.0049, REPRODUCED),
        ("3.0647", 3.0647 * 1.0051, NOT_REPRODUCED),
        ("3.0647", np.nan, NOT_REPRODUCED),
        ("0.6312", np.inf, NOT_REPRODUCED),
    ],
)
def test_verdict_by_last_digit_or_tolerance(text, computed, verdict):
    assert compared("item", "where", text, computed, "", 0.005, "").verdict == verdict
    assert agrees(printed_number(text), computed, 0.005) == (verdict == REPRODUCED)
