"""Check a stability certificate again: python check_certificate.py CERTIFICATE. Needs python-flint and nothing else.

The certificate holds a matrix T(s) = sum M s^p g_k exp(-s tau_k) in hexadecimal floats, ranges of the delays and gains,
a line Re s = right_of, the ends of intervals of that line, and a number of roots. Every inequality of the theory in
this folder's `__init__` is evaluated anew, with f = det T from exact rational determinants.
"""

import hashlib
import itertools
import json
import sys
from pathlib import Path
from typing import Any

from flint import acb, acb_poly, arb, arb_poly, ctx, fmpq, fmpq_mat

ORDER = 12


def demand(holds: bool, otherwise: str) -> None:
    """Refuse the certificate where something does not hold."""
    if not holds:
        raise ValueError(f"not proven: {otherwise}")


def number(text: str) -> float:
    """Return a hexadecimal float."""
    return float.fromhex(text)


def exact(text: str) -> fmpq:
    """Return a hexadecimal float as the rational number it is."""
    return fmpq(*number(text).as_integer_ratio())


def expanded(terms: list[Any]) -> tuple[dict[tuple[int, ...], list[fmpq]], list[int], int]:
    """Return {exponents of z: coefficients of s} of det T, the delays and the degree in s, by exact interpolation."""
    n = len(terms[0][2])
    delays = sorted({k for _, k, _ in terms if k is not None})
    degree = sum(max(p for p, _, M in terms if any(exact(row[j]) != 0 for row in M)) for j in range(n))
    rows = [
        {i for _, own, M in terms if own == k for i in range(n) if any(exact(v) != 0 for v in M[i])}
        for k in delays
    ]
    columns = [
        {j for _, own, M in terms if own == k for j in range(n) if any(exact(row[j]) != 0 for row in M)}
        for k in delays
    ]
    sizes = [degree + 1, *(1 + min(len(r), len(c)) for r, c in zip(rows, columns, strict=True))]
    matrices = [(p, k, fmpq_mat([[exact(v) for v in row] for row in M])) for p, k, M in terms]
    values = {}
    for place in itertools.product(*map(range, sizes)):
        z = dict(zip(delays, place[1:], strict=True))
        total = fmpq_mat(n, n)
        for p, k, M in matrices:
            total += M * fmpq(place[0] ** p * (1 if k is None else z[k]))
        values[place] = total.det()
    for axis, size in enumerate(sizes):
        inverse = fmpq_mat([[k**m for m in range(size)] for k in range(size)]).inv()
        values = {
            place: sum(
                (
                    inverse[place[axis], k] * values[(*place[:axis], k, *place[axis + 1 :])]
                    for k in range(size)
                ),
                fmpq(0),
            )
            for place in values
        }
    found: dict[tuple[int, ...], list[fmpq]] = {}
    for place, value in values.items():
        found.setdefault(place[1:], [fmpq(0)] * sizes[0])[place[0]] = value
    return {alpha: c for alpha, c in found.items() if any(v != 0 for v in c)}, delays, degree


def terms_of_f(expansion: Any, line: arb, delays: list[arb], gains: list[arb]) -> list[tuple[arb_poly, arb]]:
    """Return (polynomial, lag) of s -> f(s + line), the part without lag first."""
    polynomials, numbers, _ = expansion
    first, rest = arb_poly([0]), []
    for alpha, coefficients in polynomials.items():
        weight, lag = arb(1), arb(0)
        for k, exponent in zip(numbers, alpha, strict=True):
            weight, lag = weight * gains[k] ** exponent, lag + delays[k] * exponent
        p = arb_poly([arb(c) for c in coefficients])(arb_poly([line, 1])) * (weight * (-line * lag).exp())
        if lag == 0:
            first += p
        else:
            rest.append((p, lag))
    return [(first, arb(0)), *rest]


def taylor(f: list[tuple[arb_poly, arb]], omega: arb) -> list[acb]:
    """Return the first Taylor coefficients of h -> f(j (omega + h))."""
    total = acb_poly([0])
    for p, lag in f:
        turn, exponential = acb(0, -lag), [acb(1)]
        for k in range(1, ORDER):
            exponential.append(exponential[-1] * turn / k)
        shifted = acb_poly(p)(acb_poly([acb(0, omega), acb(0, 1)])) * acb_poly(exponential)
        total += shifted.truncate(ORDER) * (turn * omega).exp()
    coefficients = total.coeffs()
    return coefficients + [acb(0)] * (ORDER - len(coefficients))


def roots(f: list[tuple[arb_poly, arb]], degree: int, points: list[float]) -> arb:
    """Check every inequality; return the ball of the number of roots."""
    c, W = f[0][0][degree], arb(points[-1])
    rest = sum(
        (
            a.abs_upper() * W ** (k - degree)
            for i, (p, _) in enumerate(f)
            for k, a in enumerate(p.coeffs())
            if i or k < degree
        ),
        arb(0),
    )
    demand(rest < c.abs_lower(), "something may vanish far out")
    phase, before = arb(0), None
    demand(points[0] == 0.0, "the line does not begin at zero")
    for a, b in itertools.pairwise(points):
        F, h = taylor(f, arb(a)), arb(b) - arb(a)
        demand(h > 0, f"the interval {a} to {b} is none")
        last = taylor(f, arb(a).union(arb(b)))[-1].abs_upper() * h ** (ORDER - 1)
        by_series = sum((v.abs_upper() * h**k for k, v in enumerate(F[1:-1], 1)), last)
        by_sizes = arb(0)
        for i, (p, _) in enumerate(f):
            moved = acb_poly(p)(acb_poly([acb(0, a), acb(0, 1)])).coeffs()
            by_sizes += sum(
                (v.abs_upper() * h**k * (2 if i else min(k, 1)) for k, v in enumerate(moved)), arb(0)
            )
        free = by_series < F[0].abs_lower() or by_sizes < F[0].abs_lower()
        demand(free, f"the function may vanish between {a} and {b} rad/s")
        phase, before = (phase if before is None else phase + (F[0] / before).arg()), F[0]
    end = taylor(f, W)[0]
    if before is not None:
        phase += (end / before).arg()
    return arb(degree) / 2 + ((end / (c * acb(0, W) ** degree)).arg() - phase) / arb.pi()


def ball(low: float, high: float) -> arb:
    """Return a ball around an interval."""
    return arb(low) if low == high else arb(low).union(arb(high))


def check(text: str) -> str:
    """Return what is proven; raise a ValueError, or an error of reading, where it is not."""
    data = json.loads(text)
    told = data.pop("sha256")
    digest = hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
    demand(told == digest, "the text was altered")
    demand(data["format"] == "susp_ctrl stability certificate 1", "the format is unknown")
    ctx.prec = 2 * data["precision"]
    expansion, line = expanded(data["terms"]), arb(number(data["right_of"]))
    box, split = (
        [(number(row[0]), number(row[1])) for row in data["delays"] + data["gains"]],
        len(data["delays"]),
    )

    def function(part: list[tuple[float, float]]) -> list[tuple[arb_poly, arb]]:
        balls = [ball(*row) for row in part]
        return terms_of_f(expansion, line, balls[:split], balls[split:])

    centre = [(0.5 * (low + high),) * 2 for low, high in box]
    counted = roots(function(centre), expansion[2], [number(p) for p in data["centre"]]).unique_fmpz()
    demand(counted == data["roots"], "another number of roots")

    def excluded(part: list[tuple[float, float]], tree: dict[str, Any]) -> None:
        if "points" in tree:
            roots(function(part), expansion[2], [number(p) for p in tree["points"]])
            return
        k, middle = tree["split"], number(tree["at"])
        demand(part[k][0] <= middle <= part[k][1], "the parts do not make the box")
        excluded([*part[:k], (part[k][0], middle), *part[k + 1 :]], tree["low"])
        excluded([*part[:k], (middle, part[k][1]), *part[k + 1 :]], tree["high"])

    if any(low < high for low, high in box):
        excluded(box, data["parts"])
    return f"proven: {data['roots']} roots with real part above {number(data['right_of']):g} rad/s"


if __name__ == "__main__":
    print(check(Path(sys.argv[1]).read_text(encoding="utf-8")))
