"""Physical constants, and where places end. Importing scipy for the speed of light takes 0.1 s."""

c = 299_792_458.0
"""Speed of light in vacuum [m/s], by definition of the metre."""
FARTHEST = 4.1e7
"""No coordinate is larger [m]: the circumference of the earth. What is beyond is no place, or no metre."""
SAME_PLACE = 1e-6
"""Antennas that are closer are at the same place [m]: no survey tells them apart."""
SAME_DELAY = 1e-9
"""Delays that differ by less may be one [s]: about a resolution cell, and 0.3 m of timing and surveying; chosen."""
