"""Exponentials and logarithms of arrays, in loops that the compiler turns into vector code: rational functions.

The approximations are those of the Cephes library (Moshier, 1989), within two units of the last place. Results lie in
other arrays than arguments: loops over one that is overwritten stay scalar.
"""

import numpy as np
from numpy.typing import NDArray

from trackers.compiled.jit import compiled

LEAST = -600.0  # the exponential of what is below is that of this, whose products are normal numbers too
LOG2E, LN2, LN2_HIGH, LN2_LOW = 1.4426950408889634, 0.693359375, 6.93145751953125e-1, 1.42860682030941723212e-6


@compiled
def exponentials(x: NDArray, out: NDArray, power: NDArray) -> None:
    """Exponentials of x (n,), at most 709, into out (n,); power (n,) int64 is work space."""
    factor = power.view(np.float64)
    for i in range(len(x)):
        v = max(x[i], LEAST)
        n = np.floor(LOG2E * v + 0.5)
        v = (v - n * LN2_HIGH) - n * LN2_LOW
        s = v * v
        p = v * ((1.26177193074810590878e-4 * s + 3.02994407707441961300e-2) * s + 9.99999999999999999910e-1)
        q = ((3.00198505138664455042e-6 * s + 2.52448340349684104192e-3) * s + 2.27265548208155028766e-1) * s + 2.0
        out[i] = 1.0 + 2.0 * p / (q - p)
        power[i] = (np.int64(n) + 1023) << 52
    for i in range(len(x)):
        out[i] *= factor[i]


@compiled
def logarithms(x: NDArray, out: NDArray, power: NDArray, part: NDArray) -> None:
    """Logarithms of x (n,), normal and positive, into out (n,); power and part (n,) int64 are work space."""
    bits = x.view(np.int64)
    mantissa = part.view(np.float64)
    for i in range(len(x)):
        power[i] = (bits[i] >> 52) - 1022
        part[i] = (bits[i] & 0x000FFFFFFFFFFFFF) | 0x3FE0000000000000
    for i in range(len(x)):
        m = mantissa[i]
        small = m < 0.70710678118654752440
        e = power[i] - (1.0 if small else 0.0)
        f = (m + m - 1.0) if small else (m - 1.0)
        z = f * f
        p = ((1.01875663804580931796e-4 * f + 4.97494994976747001425e-1) * f + 4.70579119878881725854e0) * f
        p = ((p + 1.44989225341610930846e1) * f + 1.79368678507819816313e1) * f + 7.70838733755885391666e0
        q = ((f + 1.12873587189167450590e1) * f + 4.52279145837532221105e1) * f + 8.29875266912776603211e1
        q = (q * f + 7.11544750618563894466e1) * f + 2.31251620126765340583e1
        out[i] = f + (f * (z * p / q) - e * 2.121944400546905827679e-4 - 0.5 * z) + e * LN2
