"""Libraries that some of nichechain needs, and the rest does without."""

from __future__ import annotations

from nichechain.core.errors import NichechainError

_INSTALLED_AS = {
    "gymnasium_robotics": "gymnasium-robotics",
    "jax": "'nichechain[qdax]'",
    "qdax": "'nichechain[qdax]'",
}
"""How pip calls what is imported by another name."""


def missing(error: ModuleNotFoundError, what: str) -> NichechainError:
    """The error that says which library something needs.

    Parameters
    ----------
    error : ModuleNotFoundError
        Of the library.
    what : str
        What needs it, such as ``recording QDax``.
    """
    module = (error.name or str(error)).partition(".")[0]
    name = _INSTALLED_AS.get(module, module)
    return NichechainError(f"{what} needs {module}, which is not installed: pip install {name}")
