"""Numbers as they are written in tables, with the digits of the program's reports."""

import math

import numpy as np


def plain(number):
    """A number with all its digits."""
    if math.isinf(number):
        return "inf" if number > 0 else "-inf"
    return np.format_float_positional(number, trim="-")


def with_exponent(number, digits=None):
    """As 1.5e-7, with this number of digits after the point, or all."""
    if digits is None:
        text = np.format_float_scientific(number, trim="-", exp_digits=1)
    else:
        text = f"{number:.{digits}e}"
    mantissa, exponent = text.split("e")
    return f"{mantissa}e{int(exponent)}"


def significant(number, digits):
    """A number to this number of significant digits, with an exponent if that is shorter."""
    if math.isnan(number):
        return "–"
    if math.isinf(number):
        return plain(number)
    if number == 0:
        return "0"
    exponent = math.floor(math.log10(abs(number)))
    if -3 <= exponent < 5:
        return f"{number:.{max(0, digits - 1 - exponent)}f}"
    return with_exponent(number, digits - 1)


def short(number, digits):
    """A number with as few digits as it has, and at most this number."""
    rounded = significant(number, digits)
    if math.isnan(number):
        return rounded
    full = with_exponent(number) if "e" in rounded else plain(number)
    return min(rounded, full, key=len)


def _exponent(number):
    # The logarithm of 1000 may come out a little less than 3.
    return 0 if number == 0 else math.floor(math.log10(abs(number)) + 1e-12)


def interval(value, half):
    """A value ± half its interval, with two digits of the latter."""
    if not (math.isfinite(value) and math.isfinite(half) and half > 0):
        return significant(value, 4)
    shift = _exponent(max(abs(value), half))
    shift = 0 if -3 <= shift < 5 else shift
    value, half = value * 10.0**-shift, half * 10.0**-shift
    first = _exponent(half)
    # Rounding may make it 0.10 of 0.099.
    first = _exponent(round(half * 10.0 ** (1 - first)) * 10.0 ** (first - 1))
    decimals = max(0, 1 - first)
    text = f"{value:.{decimals}f} ± {half:.{decimals}f}"
    return f"({text})e{shift}" if shift else text
