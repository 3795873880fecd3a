"""A new study file: a commented template with units, to be edited."""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path

from susp_ctrl.errors import InputError


def new_study(name: str | Path) -> Path:
    """Write a commented template of a study file.

    Parameters
    ----------
    name : str or Path
        Name of the study, with its folder where it is not the current one; ``.toml`` may be left out. Letters,
        digits, ``_`` and ``-``.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    InputError
        A name with other characters, a folder that does not exist, or a file that is there already.
    """
    given = Path(name)
    path = given if given.suffix == ".toml" else given.with_name(f"{given.name}.toml")
    if not re.fullmatch(r"[\w-]+", path.stem):
        raise InputError(f"name = {str(name)!r} is not allowed: letters, digits, _ and - are")
    if not path.parent.is_dir():
        raise InputError(f"name = {str(name)!r} is not allowed: there is no folder {str(path.parent)!r}")
    text = files("susp_ctrl.study.settings").joinpath("template.toml").read_text(encoding="utf-8")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text.replace('name = "NAME"', f'name = "{path.stem}"', 1))
    except FileExistsError:
        raise InputError(f"name = {str(name)!r} is not allowed: {path} is there already") from None
    return path
