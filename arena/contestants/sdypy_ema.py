"""sdypy-EMA: LSCF of one reference, the poles nearest to frequencies that a person gives, as its README and showcase do.

`select_closest_poles` looks within windows of 2 to 25 Hz. So that these suit structures of any size, frequencies are given to it in a
unit in which the band ends at 5000, as that of the showcase does.
"""

import numpy as np

REQUIRES = ("sdypy-EMA==0.31.0",)
TAKES = ("responses",)
SOURCE = "sdypy-EMA, README and EMA Showcase: Model(lower, upper, pol_order_high=60), get_poles(), select_closest_poles([...])"
VARIANTS = {"sdypy-EMA": "LSCF, poles nearest to given frequencies"}
FORMS = {"acceleration": "accelerance", "velocity": "mobility", "displacement": "receptance"}


def run(test, variant):
    """Compute the poles and take those that a person named."""
    from sdypy import EMA

    kept = test.frequencies > 0  # its frequency vector begins above zero
    scale = 5000 / (test.band or test.frequencies)[-1]
    f, (lower, upper) = scale * test.frequencies, scale * np.array(test.band or test.frequencies[kept][[0, -1]])
    approximate = sorted(scale * x for x in set(test.human("frequencies")))
    H = np.ascontiguousarray(test.values[kept][:, :, 0].T)
    form = FORMS.get(test.quantity, "accelerance")
    model = EMA.Model(H, f[kept], lower=lower, upper=upper, pol_order_high=60, frf_form=form)
    model.get_poles(show_progress=False)
    model.select_closest_poles(approximate)
    model.get_constants(whose_poles="own", FRF_ind="all")
    return {"frequencies": model.nat_freq / scale, "damping_ratios": model.nat_xi, "shapes": model.A}
