"""The rule: its weights, its model file, what it is conditioned on, what its states show."""
