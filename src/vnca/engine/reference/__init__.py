"""The reference in torch: written to be read, never called by a fast path."""
