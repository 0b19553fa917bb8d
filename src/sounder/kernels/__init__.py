"""Compiled correlation kernels.

Everything compiled lives in this package, the compiler's settings in `compile` alone. Each kernel has a
readable float64 twin in `reference` to which the tests hold it.
"""
