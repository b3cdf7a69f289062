"""Contestants: a file NAME.py each, which runs in an environment of its own and knows nothing of modalscope.

REQUIRES   what is installed for it, versions pinned; () where this very environment serves
TAKES      the kinds of tests that it is made for (see `arena/child.py`)
SOURCE     where its own documentation shows these settings
VARIANTS   {name: what it is}, one row of the tables each
run(test, variant) -> {"frequencies": (n,) Hz, "damping_ratios": (n,), and where it has them "shapes": (l, n), "frequency_interval" and
    "damping_interval": (n, 2), 95 %, "marked": (n,) whether the program itself says that the mode is not sure}
"""
