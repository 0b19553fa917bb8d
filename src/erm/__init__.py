"""Environment reconstruction: from multipath components to the walls that reflected them, and back."""

__version__ = "0.1.0"
