"""Rolling a trained rule over a sequence of smoke."""
