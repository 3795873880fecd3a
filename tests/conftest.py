"""Settings of the whole test suite."""

from __future__ import annotations

import os

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # before numpy loads; as the command line does
    os.environ.setdefault(_variable, "1")

import pytest
from hypothesis import HealthCheck, settings

# Derandomised: the same systems on every machine, so that a failure can be repeated. HYPOTHESIS_PROFILE=explore
# looks for new ones.
settings.register_profile(
    "ci", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True
)
settings.register_profile("explore", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="run the slow checks too, after the quick ones")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    quick = [item for item in items if item.get_closest_marker("slow") is None]
    slow = [item for item in items if item.get_closest_marker("slow") is not None]
    if not config.getoption("--slow") and "slow" not in config.getoption("-m"):
        config.hook.pytest_deselected(items=slow)
        slow = []
    items[:] = quick + slow
