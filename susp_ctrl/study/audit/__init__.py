"""Whether the printed numbers of a publication follow from its own equations."""

from susp_ctrl.study.audit.audit import Computed, audit_section
from susp_ctrl.study.audit.roots import check_substitutions
