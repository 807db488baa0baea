"""The trained rule: hyperparameters, weights, priors and its model file."""
