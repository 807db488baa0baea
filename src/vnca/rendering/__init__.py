"""Differentiable emission–absorption rendering of stylized smoke."""
