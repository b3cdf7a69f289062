"""What speaks against a mode, in words."""

from __future__ import annotations

__all__ = ["left_open", "rarely_shown", "too_little"]

#: What is open by more than this tells nothing.
_ANYWHERE = 10.0


def left_open(apart: float, damped: float) -> str:
    """Say how far the data leave open where a mode lies, in half bandwidths and as a part of its damping."""
    if not (apart < _ANYWHERE and damped < _ANYWHERE):
        return "the data leave its frequency open by many half bandwidths, or its damping by many times its value"
    return f"the data leave its frequency open by {apart:.2g} half bandwidths and its damping by {100 * damped:.2g} %"


def rarely_shown(found: int, tried: int) -> str:
    """Say that few orders show a mode that does not stand out of coloured errors."""
    return f"shown at {found} of {tried} orders only, in data whose errors are no white noise"


def too_little(gain: float, bar: float, *, coloured: bool) -> str:
    """Return why what a group explains makes no mode: noise may explain it, or errors that are no white noise.

    Parameters
    ----------
    gain, bar : float
        What it explains and what noise may, in deviations.
    coloured : bool
        Whether the errors were counted as such.
    """
    text = (
        f"beside the modes it explains {gain:.1f} standard deviations of the noise; noise alone may explain {bar:.1f}"
    )
    if gain > bar and coloured:
        text += ", and more than that is needed here: it does not stand out of the errors of these data, which are no white noise"
    return text
