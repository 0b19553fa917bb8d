"""The studies of the letter, repeated: its tables and figures beside those of this software.

Chang et al., "Environment Reconstruction with Multi-targets Reflectors-merged Sensing Method Based on THz
Single-sided Channel Characteristics".
"""
