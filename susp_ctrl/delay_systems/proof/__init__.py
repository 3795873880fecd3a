r"""Is the number of roots right of a line a theorem? Ball arithmetic on the numbers that were given.

Every float is an exact rational number, and every result of Arb's arithmetic [1]_ is a ball that contains the exact
one, so each inequality below, once it is seen to hold for balls, is proven. Let T be the system matrix, N the sum over
its columns of the highest power of s, and

.. math:: f(s) = \det T(s) = \sum_i P_i(s) e^{-s\lambda_i}, \qquad \lambda_0 = 0 < \lambda_i,

:math:`P_0` of degree N with leading coefficient c, no other :math:`P_i` of a higher degree. `s` counts from the line.

1. **Beyond a radius W nothing vanishes.** For Re s >= 0 and |s| >= W, as :math:`|e^{-s\lambda}| \le 1`,

   .. math:: \left|\frac{f(s)}{c s^N} - 1\right| \le \frac{1}{|c|} \sum_k W^{k-N} \sum_i |p_{ik}| < 1

   (without the term c). W is the first power of two that satisfies it.
2. **On the axis.** With the Taylor coefficients :math:`F_k` of :math:`h \mapsto f(j\omega + jh)` and
   :math:`F_n(I)` that of order n anywhere on the interval I of length r (Lagrange's remainder, for the real and the
   imaginary part each), f does not vanish on I, and stays in a disc around :math:`F_0` that leaves out zero, where

   .. math:: \sum_{k=1}^{n-1} |F_k| r^k + |F_n(I)| r^n < |F_0|.

   or, where the delayed terms are small and turn fast, with the Taylor coefficients :math:`p_{ik}` of their polynomials

   .. math:: \sum_{k \ge 1} |p_{0k}| r^k + 2 \sum_{i \ge 1} \sum_{k \ge 0} |p_{ik}| r^k < |F_0|.

   Such intervals follow one another from 0 to W; negative frequencies are their mirror.
3. **The phase.** In such a disc the change of the phase is the principal argument of the quotient of two values.
   Let :math:`\Delta` be their sum from 0 to jW, and :math:`\varphi` the principal argument of f(jW)/(c (jW)^N). On the
   half circle f/(c s^N) stays within the disc of item 1, so its phase turns by :math:`2\varphi`. The argument principle
   [2]_ on the half disc gives the number of zeros with positive real part,

   .. math:: Z = \frac N2 + \frac{\varphi - \Delta}{\pi}.

   It is proven if its ball contains one integer only.
4. **A box of delays and gains.** The zeros depend continuously on them, and none lies beyond the largest W. If f
   vanishes nowhere on the axis for any point of the box (items 1 and 2 with balls for its numbers, in as many parts as
   needed), Z is the same all over it as at its centre.

The :math:`P_i` follow from values of det T at integers by interpolation, exact up to the balls' width. Where there are
too many of them, the determinant of the matrix is enclosed instead (`susp_ctrl.delay_systems.proof.delay_matrix`).

References
----------
.. [1] F. Johansson, "Arb: efficient arbitrary-precision midpoint-radius interval arithmetic", IEEE Transactions on
   Computers 66(8), 2017.
.. [2] R. Bellman, K. L. Cooke, "Differential-Difference Equations", Academic Press, 1963, chapter 12.
"""

from __future__ import annotations

from susp_ctrl.delay_systems.proof.stability_proof import StabilityProof, prove_stability

__all__ = ["StabilityProof", "prove_stability"]
