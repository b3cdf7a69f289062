"""The likelihood of modes: noise models, descent, refinement, standard deviations."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from modalscope.selection.likelihood.error_model import TERMS as TERMS, Noise as Noise

__all__ = ["TERMS", "Noise"]


def __getattr__(name: str) -> Any:
    """Load what is asked for: the modules of this package are imported one by one."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from modalscope.selection.likelihood import error_model

    return getattr(error_model, name)
