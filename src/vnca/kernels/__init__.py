"""Numerical kernels, one folder an operation."""
