"""What counts as certain: one number for every check of what users give."""

import math

FALSE_ALARM = 1e-3
"""Probability that one family of checks finds something in a clean position: of its noise floors, its spectra, its
delays, its back-to-back. A family shares it among its directions and tests (Bonferroni). With fewer than ten families
less than one clean position in a hundred is remarked."""
CERTAIN = -math.log(FALSE_ALARM)
"""Log-likelihood ratio beyond which a fault is certain: if there is none, it is exceeded with `FALSE_ALARM` at most,
whatever the distributions (Markov's inequality)."""
