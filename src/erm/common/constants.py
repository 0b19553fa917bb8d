"""Physical constants. They are exact by definition; importing scipy for them takes 0.1 s."""

c = 299_792_458.0
"""Speed of light in vacuum [m/s], by definition of the metre."""
