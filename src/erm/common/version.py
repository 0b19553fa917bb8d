"""Version of the software, which every product carries."""

__version__ = "0.1.0"
