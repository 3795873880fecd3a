"""Where the characteristic roots are, and how many lie right of a line."""

from susp_ctrl.delay_systems.roots.argument_principle import (
    ContourError,
    abscissa_by_counts,
    count_right_of,
    count_roots_right_of,
    count_unstable_roots,
)
from susp_ctrl.delay_systems.roots.polynomial_count import count_by_polynomials
from susp_ctrl.delay_systems.roots.rightmost import (
    FIRST_ANGLE,
    RootSet,
    characteristic_roots,
    is_complete,
    probable_roots,
    reach_near_axis,
    rightmost_roots,
    roots_near_axis,
    spectral_abscissa,
)
from susp_ctrl.delay_systems.roots.root_loci import RootLocus, root_locus
