"""Constants that are exact by definition: all of scipy's, for this one, would cost every command 0.1 s of start-up."""

c = 299_792_458.0
"""Speed of light in vacuum [m/s], by definition of the metre."""
