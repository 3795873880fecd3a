"""The door of the house: lazy names, a light import."""

from __future__ import annotations

import subprocess
import sys

import pytest

import susp_ctrl as sc


def test_a_bare_import_loads_no_heavy_library() -> None:
    heavy = ("control", "pandas", "matplotlib", "scipy", "numpy")
    code = f"import sys, susp_ctrl; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_public_name_resolves_and_is_listed() -> None:
    for name in sc.__all__:
        assert getattr(sc, name) is not None
        assert name in dir(sc)


def test_no_module_bears_the_name_of_a_public_function() -> None:
    import pkgutil

    modules = {m.name.rsplit(".", 1)[-1] for m in pkgutil.walk_packages(sc.__path__, "susp_ctrl.")}
    assert not modules & set(sc.__all__)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'close_lop'"):
        sc.close_lop  # noqa: B018
